//! The encoding `compact`: what a node is, given what a reader knows already.
//!
//! One [`Model`] goes through a page and tells a [`Coder`] what there is; whether that writes or reads makes no difference
//! to the model, so that both cannot but agree. The order of the fields is such that each is predicted from those before:
//! orders, then half-edges in order of the splits, normals, positions, and bounds from the leaves up.

mod entropy;
mod star;

use glam::Vec3;
use mergetree::{BoundCodes, Colour, Node, NodeId};

pub(super) use self::entropy::{Coder, Reader, Symbols, Tables, Writer, skip_symbols};
use self::star::Stars;
use super::{PageContext, Reference, colour_difference, colour_from_difference};
use crate::bounds::enclosing_radius;
use crate::rounding::{
    CONE_SHIFT, DEVIATION_SHIFT, MAX_STEPS, NORMAL_STEPS, RADIUS_SHIFT, normal_at, normal_steps,
};

/// What a page is, as far as shapes and links say it, and the nodes that the rest goes into or comes from.
pub(super) struct Part<'a> {
    pub nodes: &'a mut [Node],
    pub ids: &'a [NodeId],
    /// Where the nodes of each block begin.
    pub blocks: &'a [u32],
    pub first_block: u32,
    pub references: &'a [Reference],
    pub context: &'a PageContext,
}

impl Part<'_> {
    /// The place of a node in the page.
    fn node(&self, id: NodeId) -> Option<u32> {
        let numbering = self.context.numbering;
        let block = numbering.block(id).get().checked_sub(self.first_block)? as usize;
        let start = *self.blocks.get(block)?;
        let end = self.blocks.get(block + 1).map_or(self.nodes.len() as u32, |&end| end);
        Some(start + numbering.slot(id)).filter(|&node| node < end)
    }
}

/// Goes through pages; holds what can be used again from one to the next.
#[derive(Default)]
pub(super) struct Model {
    stars: Stars,
    /// Per node what it is to the node it refers to.
    kin: Vec<Kin>,
    /// Nodes in the order of their splits.
    sequence: Vec<u32>,
    firsts: Vec<u32>,
    normals: Vec<[i32; 2]>,
    directions: Vec<[i32; 3]>,
    corners: Vec<[i32; 3]>,
    /// Per node what its children in the page demand.
    demands: Vec<Demand>,
}

/// How a node hangs in its page.
#[derive(Clone, Copy, Debug)]
struct Kin {
    /// The node whose position and normal are the best guess: that of the vertex that was divided, where it is known.
    near: u32,
    /// Parent in the page and whether it is on the left of it.
    parent: u32,
    is_left: bool,
    /// How large the subtree is, in four classes.
    class: u8,
    /// Children: 0 none, 1 one or two in the page, 2 one in another page.
    children: u8,
}

#[derive(Clone, Copy, Debug, Default)]
struct Demand {
    radius: f64,
    cone: u16,
    deviation: u16,
}

const NO_PARENT: u32 = u32::MAX;
/// So many nodes a child in another page counts for.
const OTHER_PAGE: u32 = 256;

impl Model {
    /// Codes all fields but shape and links, with a mark after each: orders, half-edges, normals, positions, radii, cones,
    /// deviations.
    pub fn page<C: Coder>(
        &mut self,
        coder: &mut C,
        part: &mut Part<'_>,
    ) -> Result<(), &'static str> {
        self.order(coder, part)?;
        coder.mark();
        self.arrange(part);
        self.adjacent(coder, part)?;
        coder.mark();
        self.normal(coder, part)?;
        coder.mark();
        self.position(coder, part)?;
        coder.mark();
        self.radius(coder, part)?;
        coder.mark();
        self.cone(coder, part)?;
        coder.mark();
        self.deviation(coder, part)?;
        coder.mark();
        Ok(())
    }

    /// Codes the colours of the nodes of the page that was coded last: the differences to those of near, of green by the class,
    /// of red and blue by how large that of green is. Where they are read, all is appended to `colours`.
    pub fn colour<C: Coder>(
        &mut self,
        coder: &mut C,
        colours: &mut Vec<Colour>,
    ) -> Result<(), &'static str> {
        /// Tables of red and blue are those after green's, and that of alpha the last one.
        const OTHERS: usize = 4;
        const ALPHA: usize = 8;
        coder.tables(9)?;
        let mut symbols = coder.symbols();
        let mut fits = true;
        for (index, kin) in self.kin.iter().enumerate() {
            let at = kin.near as usize;
            let near = if at == index { [0; 4] } else { colours[at] };
            let own = if C::WRITES { colours[index] } else { near };
            let [r, g, b, a] = colour_difference(own, near);
            let mut code = |table: usize, byte: i8| {
                let read = symbols.signed(table, byte.into());
                fits &= i8::try_from(read).is_ok();
                read as i8
            };
            let g = code(kin.class.into(), g);
            let size = g.unsigned_abs();
            let others = OTHERS + [2, 8, 24].iter().filter(|&&least| size >= least).count();
            let difference = [code(others, r), g, code(others, b), code(ALPHA, a)];
            if !C::WRITES {
                colours.push(colour_from_difference(difference, near));
            }
        }
        symbols.end();
        if fits { Ok(()) } else { Err("has a colour that cannot be") }
    }

    fn order<C: Coder>(&mut self, coder: &mut C, part: &mut Part<'_>) -> Result<(), &'static str> {
        const TOP: usize = 2;
        coder.tables(3)?;
        let mut symbols = coder.symbols();
        let mut last = 0;
        for index in 0..part.nodes.len() {
            let own = i64::from(part.nodes[index].order);
            let reference = part.references[index];
            let order = if reference.is_parent {
                let parent = &part.nodes[reference.node as usize];
                let table = usize::from(parent.left == Some(part.ids[index]));
                let above = i64::from(parent.order) - 1;
                let down = symbols.value(table, above.wrapping_sub(own) as u64);
                above.checked_sub_unsigned(down)
            } else {
                let order = last + symbols.signed(TOP, own - last);
                last = order;
                Some(order)
            };
            // The largest one stands for none in a front.
            let order = order.filter(|order| (0..i64::from(u32::MAX)).contains(order));
            part.nodes[index].order = order.ok_or("has an order that cannot be")? as u32;
        }
        symbols.end();
        Ok(())
    }

    /// Finds out how nodes hang together and in which order they are split.
    fn arrange(&mut self, part: &Part<'_>) {
        self.kin.clear();
        for (index, reference) in (0..).zip(part.references) {
            let kin = if reference.is_parent {
                let parent = reference.node;
                let is_left = part.nodes[parent as usize].left == Some(part.ids[index as usize]);
                let above = self.kin[parent as usize];
                let near = if is_left || above.parent == NO_PARENT { parent } else { above.near };
                Kin { near, parent, is_left, class: 0, children: 0 }
            } else {
                let near = reference.node;
                Kin { near, parent: NO_PARENT, is_left: false, class: 3, children: 0 }
            };
            self.kin.push(kin);
        }
        // Sizes of subtrees, from the leaves up; parents stand before their children.
        self.firsts.clear();
        self.firsts.resize(part.nodes.len(), 1);
        let mut within = std::mem::take(&mut self.sequence);
        within.clear();
        within.resize(part.nodes.len(), 0);
        for index in (0..part.nodes.len()).rev() {
            let children = part.nodes[index].children().count() as u32;
            let outside = children - within[index];
            let size = self.firsts[index].saturating_add(outside * OTHER_PAGE);
            let kin = &mut self.kin[index];
            kin.children = if outside > 0 { 2 } else { u8::from(children > 0) };
            if kin.parent != NO_PARENT {
                kin.class =
                    [0, 0, 1, 1][size.min(3) as usize] + u8::from(size > 3) + u8::from(size > 15);
                let parent = kin.parent as usize;
                self.firsts[parent] = self.firsts[parent].saturating_add(size);
                within[parent] += 1;
            }
        }
        self.sequence = within;
        self.sort(part);
    }

    /// Nodes by falling order, and by place in the page where that is equal.
    fn sort(&mut self, part: &Part<'_>) {
        let orders = part.nodes.iter().map(|node| node.order);
        let (least, most) = (orders.clone().min().unwrap_or(0), orders.clone().max().unwrap_or(0));
        let range = (most - least) as usize + 1;
        self.sequence.clear();
        if range > 4 * part.nodes.len() + 1024 {
            self.sequence.extend(0..part.nodes.len() as u32);
            self.sequence.sort_by_key(|&node| std::cmp::Reverse(part.nodes[node as usize].order));
            return;
        }
        self.firsts.clear();
        self.firsts.resize(range, 0);
        for order in orders.clone() {
            self.firsts[(most - order) as usize] += 1;
        }
        let mut first = 0;
        for count in &mut self.firsts {
            first += std::mem::replace(count, first);
        }
        self.sequence.resize(part.nodes.len(), 0);
        for (node, order) in (0..).zip(orders) {
            let place = &mut self.firsts[(most - order) as usize];
            self.sequence[*place as usize] = node;
            *place += 1;
        }
    }

    fn adjacent<C: Coder>(
        &mut self,
        coder: &mut C,
        part: &mut Part<'_>,
    ) -> Result<(), &'static str> {
        coder.tables(star::NUM_TABLES)?;
        self.stars.restart(part.nodes.len());
        let mut symbols = coder.symbols();
        for &node in &self.sequence {
            symbols = self.stars.node(symbols, part, node, self.kin[node as usize]);
        }
        symbols.end();
        self.stars.check()
    }

    fn normal<C: Coder>(&mut self, coder: &mut C, part: &mut Part<'_>) -> Result<(), &'static str> {
        coder.tables(4)?;
        let mut symbols = coder.symbols();
        self.normals.clear();
        self.directions.clear();
        for (index, node) in part.nodes.iter_mut().enumerate() {
            let kin = self.kin[index];
            let near = self.normals.get(kin.near as usize).copied().unwrap_or_default();
            let own = normal_steps(node.normal);
            let mut steps = [0; 2];
            for axis in 0..2 {
                let difference = i64::from(own[axis] - near[axis]);
                let difference = symbols.signed(kin.class.into(), difference);
                let step = i64::from(near[axis]).wrapping_add(difference);
                if step.unsigned_abs() > NORMAL_STEPS as u64 {
                    return Err("has a normal that cannot be");
                }
                steps[axis] = step as i32;
            }
            self.normals.push(steps);
            self.directions.push(direction(steps));
            node.normal = normal_at(steps);
        }
        symbols.end();
        Ok(())
    }

    fn position<C: Coder>(
        &mut self,
        coder: &mut C,
        part: &mut Part<'_>,
    ) -> Result<(), &'static str> {
        /// Tables of the axis that normals point along are those after the others.
        const ALONG: usize = 4;
        coder.tables(8)?;
        let mut symbols = coder.symbols();
        self.corners.clear();
        let rounding = part.context.rounding;
        for (index, node) in part.nodes.iter_mut().enumerate() {
            let kin = self.kin[index];
            let near = self.corners.get(kin.near as usize).copied().unwrap_or_default();
            let own =
                if C::WRITES { rounding.corner(node.position).unwrap_or_default() } else { [0; 3] };
            let [own_way, near_way] = [index, kin.near as usize].map(|node| self.directions[node]);
            let normal = [0, 1, 2].map(|axis| own_way[axis] + near_way[axis]);
            let along = largest(normal);
            const OTHERS: [[usize; 2]; 3] = [[1, 2], [2, 0], [0, 1]];
            let [b, c] = OTHERS[along];
            let mut moved = [0i64; 3];
            let mut flat = 0;
            for axis in [b, c, along] {
                let mut expected = 0;
                let mut table = usize::from(kin.class);
                if axis == along {
                    // In the plane of the normals.
                    expected = divide(-flat, normal[along].into());
                    table += ALONG;
                }
                let difference = i64::from(own[axis] - near[axis]) - expected;
                let difference = symbols.signed(table, difference);
                moved[axis] = expected.wrapping_add(difference);
                // Further than any two corners are apart.
                if moved[axis].unsigned_abs() > 2 * MAX_STEPS as u64 {
                    return Err("has a position that cannot be");
                }
                flat += moved[axis] * i64::from(normal[axis]);
            }
            let corner = [0, 1, 2].map(|axis| near[axis] + moved[axis] as i32);
            if corner.iter().any(|c| c.abs() > MAX_STEPS) {
                return Err("has a position that cannot be");
            }
            self.corners.push(corner);
            node.position = rounding.at(corner);
        }
        symbols.end();
        Ok(())
    }

    fn radius<C: Coder>(&mut self, coder: &mut C, part: &mut Part<'_>) -> Result<(), &'static str> {
        coder.tables(3)?;
        let mut symbols = coder.symbols();
        self.demands.clear();
        self.demands.resize(part.nodes.len(), Demand::default());
        for index in (0..part.nodes.len()).rev() {
            let kin = self.kin[index];
            let position = part.nodes[index].position;
            let mut demand = self.demands[index].radius;
            if kin.children == 0 {
                demand = distance(position, part.nodes[kin.near as usize].position);
            }
            let expected = BoundCodes::encode_up(demand).unwrap_or(BoundCodes::MAX);
            let expected = i64::from(raised(expected, RADIUS_SHIFT));
            let own = i64::from(code(part.nodes[index].radius) >> RADIUS_SHIFT);
            let difference = symbols.signed(kin.children.into(), own - expected);
            let radius = bound(expected.wrapping_add(difference), RADIUS_SHIFT, BoundCodes::MAX)?;
            part.nodes[index].radius = radius;
            if kin.parent != NO_PARENT {
                let parent = part.nodes[kin.parent as usize].position;
                let demand = &mut self.demands[kin.parent as usize];
                demand.radius = demand.radius.max(enclosing_radius(parent, position, radius));
            }
        }
        symbols.end();
        Ok(())
    }

    fn cone<C: Coder>(&mut self, coder: &mut C, part: &mut Part<'_>) -> Result<(), &'static str> {
        const INNER: usize = 4;
        const FULL: usize = 6;
        coder.tables(7)?;
        let mut symbols = coder.symbols();
        for index in (0..part.nodes.len()).rev() {
            let kin = self.kin[index];
            let demand = self.demands[index].cone;
            let (table, expected) = if kin.children == 0 {
                let [own, near] = [index, kin.near as usize].map(|node| self.normals[node]);
                let turned = (own[0] - near[0]).abs() + (own[1] - near[1]).abs();
                let class = [8, 20, 48].iter().filter(|&&least| turned >= least).count();
                (class, BoundCodes::ONE >> CONE_SHIFT)
            } else if demand >= BoundCodes::ONE >> CONE_SHIFT {
                (FULL, demand)
            } else {
                (INNER + usize::from(kin.children - 1), demand)
            };
            let own = i64::from(code(part.nodes[index].cone_sine) >> CONE_SHIFT);
            let expected = i64::from(expected);
            let difference = symbols.signed(table, own - expected);
            let cone = expected.wrapping_add(difference);
            part.nodes[index].cone_sine = bound(cone, CONE_SHIFT, BoundCodes::ONE)?;
            if kin.parent != NO_PARENT {
                let demand = &mut self.demands[kin.parent as usize].cone;
                *demand = (*demand).max(cone as u16);
            }
        }
        symbols.end();
        Ok(())
    }

    fn deviation<C: Coder>(
        &mut self,
        coder: &mut C,
        part: &mut Part<'_>,
    ) -> Result<(), &'static str> {
        coder.tables(3)?;
        let mut symbols = coder.symbols();
        let least = BoundCodes::encode_up(part.context.rounding.error()).unwrap_or(BoundCodes::MAX);
        let least = raised(least, DEVIATION_SHIFT);
        for index in (0..part.nodes.len()).rev() {
            let kin = self.kin[index];
            let expected = i64::from(self.demands[index].deviation.max(least));
            let own = i64::from(code(part.nodes[index].deviation) >> DEVIATION_SHIFT);
            let difference = symbols.signed(kin.children.into(), own - expected);
            let deviation = expected.wrapping_add(difference);
            part.nodes[index].deviation = bound(deviation, DEVIATION_SHIFT, BoundCodes::MAX)?;
            if kin.parent != NO_PARENT {
                let demand = &mut self.demands[kin.parent as usize].deviation;
                *demand = (*demand).max(deviation as u16);
            }
        }
        symbols.end();
        Ok(())
    }
}

/// The code of a bound that has one.
fn code(bound: f32) -> u16 {
    BoundCodes::exact(bound).unwrap_or_default()
}

fn raised(code: u16, zeros: u32) -> u16 {
    ((u32::from(code) + (1 << zeros) - 1) >> zeros) as u16
}

fn bound(code: i64, zeros: u32, max: u16) -> Result<f32, &'static str> {
    u16::try_from(code)
        .ok()
        .filter(|&code| code <= max >> zeros)
        .map(|code| BoundCodes::decode(code << zeros))
        .ok_or("has a radius, cone or deviation that cannot be")
}

fn distance(a: Vec3, b: Vec3) -> f64 {
    enclosing_radius(a, b, 0.0)
}

/// A normal as a vector whose components' magnitudes add up to [`NORMAL_STEPS`], or nearly.
#[inline(always)]
fn direction([x, y]: [i32; 2]) -> [i32; 3] {
    let z = NORMAL_STEPS - x.abs() - y.abs();
    let fold = (-z).max(0);
    let sign = |c: i32| if c < 0 { -1 } else { 1 };
    [x - fold * sign(x), y - fold * sign(y), z]
}

/// The axis of the largest component, the first one of those, and z for a vector of nothing.
#[inline(always)]
fn largest(v: [i32; 3]) -> usize {
    let [x, y, z] = v.map(i32::abs);
    if x >= y && x >= z && x > 0 {
        0
    } else if y >= z && y > 0 {
        1
    } else {
        2
    }
}

/// A quotient rounded to the nearest integer, halves up; zero where the divisor is zero. It is below 2^31, and the divisor
/// small; so it differs from a half by more than what is lost in floating point, which is faster.
#[inline(always)]
fn divide(a: i64, b: i64) -> i64 {
    if b == 0 {
        return 0;
    }
    const UP: i64 = 1 << 32;
    (a as f64 / b as f64 + 0.5 + UP as f64) as i64 - UP
}
