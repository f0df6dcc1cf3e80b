//! The mesh around the nodes of a page, as far as the page tells: which half-edges are each other's reverse.
//!
//! When the nodes of a page are split in order, what a node says of its surroundings is mostly known from the nodes before
//! it. Then a half-edge can be named by how many steps it lies from one that is known.

use std::collections::HashMap;

use halfedge::HalfEdgeId;
use mergetree::{HalfEdgeName, NodeId};

use super::Part;
use super::entropy::Coder;
use crate::column::{unzigzag, zigzag};

/// Not known, or not there.
const NONE: u32 = u32::MAX;
/// Half-edges about a vertex that are looked at, so that a file cannot make it take long.
const MAX_STEPS: usize = 32;

/// Tables of this part.
const X: usize = 0;
const W: usize = 1;
const Z: usize = 2;
const Y: usize = 3;
const KIND: usize = 4;
const INSIDE: usize = 5;
const CORNER: usize = 6;
const KNOWN: usize = 7;
const OUTSIDE: usize = 8;
const BASE: usize = 9;
pub(super) const NUM_TABLES: usize = 10;

/// What is known of reverses. Half-edges of the page's nodes are 6·node + k; after them come those of faces outside the page
/// that were named, three each.
#[derive(Default)]
pub(super) struct Stars {
    reverse: Vec<u32>,
    /// Per face outside the page the name of its first half-edge.
    outside: Vec<u32>,
    /// The other way round, where names are to be written.
    outside_of: HashMap<u32, u32>,
    last_outside: u32,
    last_base: u32,
    steps: Vec<u32>,
}

#[inline]
fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

#[inline]
fn prev(h: u32) -> u32 {
    if h % 3 == 0 { h + 2 } else { h - 1 }
}

impl Stars {
    pub fn restart(&mut self, nodes: usize) {
        self.reverse.clear();
        self.reverse.resize(6 * nodes, NONE);
        self.outside.clear();
        self.outside_of.clear();
        self.last_outside = 0;
        self.last_base = 0;
    }

    /// The half-edges out of a vertex as far as they are known, from one of them on: round one way, and where that ends,
    /// from there round the other way.
    fn go_round(&mut self, from: u32) {
        self.steps.clear();
        self.steps.push(from);
        let mut g = from;
        while self.steps.len() < MAX_STEPS {
            g = self.reverse[prev(g) as usize];
            if g == from {
                return;
            }
            if g == NONE {
                break;
            }
            self.steps.push(g);
        }
        let mut g = from;
        while self.steps.len() < MAX_STEPS {
            g = self.reverse[g as usize];
            if g == NONE {
                return;
            }
            g = next(g);
            if g == from {
                return;
            }
            self.steps.push(g);
        }
    }

    fn link(&mut self, a: u32, b: u32) {
        if a != NONE {
            self.reverse[a as usize] = b;
        }
        if b != NONE {
            self.reverse[b as usize] = a;
        }
    }

    fn reverse_of(&self, h: u32) -> u32 {
        if h == NONE { NONE } else { self.reverse[h as usize] }
    }

    /// The half-edges `w, x, y, z` of a node. `parent` is the node it hangs under, and whether on its left.
    pub fn node<C: Coder>(
        &mut self,
        coder: &mut C,
        part: &mut Part<'_>,
        node: u32,
        parent: Option<(u32, bool)>,
    ) -> Result<(), &'static str> {
        let [w, x, y, z] = part.nodes[node as usize].adjacent.map(|name| name.map(HalfEdgeId::get));
        // A half-edge out of the vertex that is divided.
        self.steps.clear();
        if let Some((parent, on_the_left)) = parent {
            let second_face = part.nodes[parent as usize].has_second_face();
            let k = match (on_the_left, second_face) {
                (true, _) => 0,
                (false, true) => 3,
                (false, false) => 1,
            };
            self.go_round(6 * parent + k);
        }
        let x = self.outgoing(coder, part, node, X, x, 0)?;
        if x != NONE {
            self.go_round(x);
        }
        let w = self.incoming(coder, part, node, W, w, self.reverse_of(x))?;
        let z = self.outgoing(coder, part, node, Z, z, usize::from(x != NONE))?;
        let y = self.incoming(coder, part, node, Y, y, self.reverse_of(z))?;
        if !C::WRITES {
            let mut adjacent = [None; 4];
            for (name, local) in adjacent.iter_mut().zip([w, x, y, z]) {
                if local != NONE {
                    *name = Some(self.name(local, part)?);
                }
            }
            part.nodes[node as usize].adjacent = adjacent;
        }
        let own = 6 * node;
        self.link(own + 1, w);
        self.link(own + 2, x);
        if y != NONE {
            self.link(own, own + 3);
            self.link(own + 4, y);
            self.link(own + 5, z);
        }
        Ok(())
    }

    /// One that leaves the vertex: 0 for none, 1 where it is said otherwise, then by the steps to it.
    fn outgoing<C: Coder>(
        &mut self,
        coder: &mut C,
        part: &Part<'_>,
        node: u32,
        table: usize,
        wanted: Option<u32>,
        first: usize,
    ) -> Result<u32, &'static str> {
        let mut symbol = 0;
        if C::WRITES && let Some(name) = wanted {
            let h = self.find(name, part);
            let step = self.steps.iter().skip(first).position(|&step| step == h);
            symbol = step.map_or(1, |step| step as u32 + 2);
        }
        match coder.symbol(table, symbol) {
            0 => Ok(NONE),
            1 => self.far(coder, part, node, wanted),
            symbol => self.step(symbol as usize - 2 + first),
        }
    }

    /// One that ends at the vertex: 0 for the one that is expected, 1 for none, 2 where it is said otherwise, then by the
    /// steps to the one after it in its face.
    fn incoming<C: Coder>(
        &mut self,
        coder: &mut C,
        part: &Part<'_>,
        node: u32,
        table: usize,
        wanted: Option<u32>,
        expected: u32,
    ) -> Result<u32, &'static str> {
        let mut symbol = 0;
        if C::WRITES {
            match wanted {
                None => symbol = u32::from(expected != NONE),
                Some(name) => {
                    let h = self.find(name, part);
                    if h == NONE {
                        symbol = 2;
                    } else if h != expected {
                        let after = next(h);
                        let step = self.steps.iter().position(|&step| step == after);
                        symbol = step.map_or(2, |step| step as u32 + 3);
                    }
                }
            }
        }
        match coder.symbol(table, symbol) {
            0 => Ok(expected),
            1 => Ok(NONE),
            2 => self.far(coder, part, node, wanted),
            symbol => self.step(symbol as usize - 3).map(prev),
        }
    }

    fn step(&self, step: usize) -> Result<u32, &'static str> {
        self.steps.get(step).copied().ok_or("names a half-edge that is not there")
    }

    /// One that no steps lead to: of a node of the page, of a face outside that was named before, of a node outside, or of
    /// the coarsest mesh.
    fn far<C: Coder>(
        &mut self,
        coder: &mut C,
        part: &Part<'_>,
        node: u32,
        wanted: Option<u32>,
    ) -> Result<u32, &'static str> {
        const NO_SUCH: &str = "names a half-edge that cannot be";
        let num_inside = 6 * part.nodes.len() as u32;
        let names = part.context.names;
        let name = wanted.unwrap_or(0);
        let found = if C::WRITES { self.find(name, part) } else { NONE };
        let of_node = match names.resolve(HalfEdgeId::new(name)) {
            HalfEdgeName::Base(_) => None,
            HalfEdgeName::Node(id, k) => Some((id, k)),
        };
        let kind = match (found, of_node) {
            (NONE, Some(_)) => 2,
            (NONE, None) => 3,
            (h, _) => u32::from(h >= num_inside),
        };
        match coder.symbol(KIND, kind) {
            0 => {
                let distance = zigzag(i64::from(found / 6) - i64::from(node));
                let owner = i64::from(node) + unzigzag(coder.value(INSIDE, distance));
                let k = coder.symbol(CORNER, found % 6);
                if owner < 0 || owner >= part.nodes.len() as i64 || k >= 6 {
                    return Err(NO_SUCH);
                }
                Ok(6 * owner as u32 + k)
            }
            1 => {
                let back = (self.outside.len() as u32).wrapping_sub(1 + found.wrapping_sub(num_inside) / 3);
                let back = coder.value(KNOWN, back.into());
                let corner = coder.symbol(CORNER, found % 3);
                if back >= self.outside.len() as u64 || corner >= 3 {
                    return Err(NO_SUCH);
                }
                Ok(num_inside + 3 * (self.outside.len() as u32 - 1 - back as u32) + corner)
            }
            2 => {
                let (id, k) = of_node.unwrap_or((NodeId::new(0), 0));
                let distance = zigzag(i64::from(id.get()) - i64::from(self.last_outside));
                let id = i64::from(self.last_outside).wrapping_add(unzigzag(coder.value(OUTSIDE, distance)));
                let k = coder.symbol(CORNER, k);
                if id < 0 || id > i64::from(names.max_node().get()) || k >= 6 {
                    return Err(NO_SUCH);
                }
                self.last_outside = id as u32;
                self.name_outside(names.of_node(NodeId::new(id as u32), k / 3 * 3).get(), k % 3, part)
            }
            3 => {
                let distance = zigzag(i64::from(name) - i64::from(self.last_base));
                let name = i64::from(self.last_base).wrapping_add(unzigzag(coder.value(BASE, distance)));
                if name < 0 || name >= i64::from(part.context.num_base_half_edges) {
                    return Err(NO_SUCH);
                }
                self.last_base = name as u32;
                self.name_outside(name as u32 / 3 * 3, name as u32 % 3, part)
            }
            _ => Err(NO_SUCH),
        }
    }

    /// Takes a face outside the page among those that are known, and returns a half-edge of it.
    fn name_outside(&mut self, first: u32, corner: u32, part: &Part<'_>) -> Result<u32, &'static str> {
        let face = self.outside.len() as u32;
        self.outside.push(first);
        self.reverse.extend([NONE; 3]);
        self.outside_of.insert(first, face);
        Ok(6 * part.nodes.len() as u32 + 3 * face + corner)
    }

    /// The half-edge of this name, if it is known.
    fn find(&self, name: u32, part: &Part<'_>) -> u32 {
        let first = match part.context.names.resolve(HalfEdgeId::new(name)) {
            HalfEdgeName::Base(h) => h / 3 * 3,
            HalfEdgeName::Node(id, k) => {
                if let Some(node) = part.node(id) {
                    return 6 * node + k;
                }
                name - k % 3
            }
        };
        let Some(face) = self.outside_of.get(&first) else { return NONE };
        6 * part.nodes.len() as u32 + 3 * face + (name - first)
    }

    /// The name of a half-edge, if there can be one.
    fn name(&self, h: u32, part: &Part<'_>) -> Result<HalfEdgeId, &'static str> {
        let num_inside = 6 * part.nodes.len() as u32;
        if h < num_inside {
            return Ok(part.context.names.of_node(part.ids[h as usize / 6], h % 6));
        }
        let name = self.outside[(h - num_inside) as usize / 3] + (h - num_inside) % 3;
        part.context.half_edge(name.into()).ok_or("names a half-edge that cannot be")
    }
}
