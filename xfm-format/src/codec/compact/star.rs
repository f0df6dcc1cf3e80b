//! The mesh around the nodes of a page, as far as the page tells: which half-edges are each other's reverse.
//!
//! When the nodes of a page are split in order, what a node says of its surroundings is mostly known from the nodes before
//! it. Then a half-edge can be named by how many steps it lies from one that is known.

use std::collections::HashMap;

use halfedge::HalfEdgeId;
use mergetree::{HalfEdgeName, NodeId};

use super::entropy::Symbols;
use super::{Kin, NO_PARENT, Part};

/// Not known, or not there.
const NONE: u32 = u32::MAX;
/// Half-edges about a vertex that are looked at, so that a file cannot make it take long.
const MAX_STEPS: u32 = 32;

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

/// What is known of reverses.
///
/// Faces have places: those of the page's nodes 2·node and the one after it, and after them those outside the page that
/// were named. Half-edge `i` of the face in place `p` is 4·p + i here.
#[derive(Default)]
pub(super) struct Stars {
    /// Per half-edge the reverse of the one before it in its face: the next one out of the same vertex.
    turned: Vec<u32>,
    /// Twice the number of nodes: where the places of faces outside begin.
    first_outside: u32,
    /// Per face outside the page the name of its first half-edge.
    outside: Vec<u32>,
    /// The other way round, where names are to be written.
    outside_of: HashMap<u32, u32>,
    last_outside: u32,
    last_base: u32,
    /// Whether the page names what cannot be.
    is_bad: bool,
}

#[inline(always)]
fn next(h: u32) -> u32 {
    if h & 3 == 2 { h - 2 } else { h + 1 }
}

#[inline(always)]
fn prev(h: u32) -> u32 {
    if h & 3 == 0 { h + 2 } else { h - 1 }
}

/// Half-edge `k`, 0 to 5, of a node of the page.
#[inline(always)]
fn of_node(node: u32, k: u32) -> u32 {
    8 * node + k + u32::from(k >= 3)
}

impl Stars {
    pub fn restart(&mut self, nodes: usize) {
        self.turned.clear();
        self.turned.resize(8 * nodes, NONE);
        self.first_outside = 2 * nodes as u32;
        self.outside.clear();
        self.outside_of.clear();
        self.last_outside = 0;
        self.last_base = 0;
        self.is_bad = false;
    }

    /// Whether the nodes so far name what can be.
    pub fn check(&self) -> Result<(), &'static str> {
        if self.is_bad { Err("names a half-edge that cannot be") } else { Ok(()) }
    }

    /// The half-edges out of a vertex as far as they are known, from one of them on: round one way, and where that ends,
    /// from there round the other way. This is the one `steps` after `from`; `NONE` where they end before.
    #[inline(always)]
    fn go_round(&self, from: u32, steps: u32) -> u32 {
        if from == NONE || steps >= MAX_STEPS {
            return NONE;
        }
        let mut g = from;
        for done in 0..steps {
            let turned = self.turned[g as usize];
            if turned == NONE {
                return self.go_back(from, steps - done);
            }
            if turned == from {
                return NONE;
            }
            g = turned;
        }
        g
    }

    fn go_back(&self, from: u32, steps: u32) -> u32 {
        let mut g = from;
        for _ in 0..steps {
            g = self.reverse_of(g);
            if g == NONE {
                return NONE;
            }
            g = next(g);
            if g == from {
                return NONE;
            }
        }
        g
    }

    /// How many steps it takes to come to `h`, from so many on.
    fn steps_to(&self, from: u32, first: u32, h: u32) -> Option<u32> {
        let steps = first..MAX_STEPS;
        let mut round = steps.map(|steps| self.go_round(from, steps)).take_while(|&h| h != NONE);
        round.position(|step| step == h).map(|steps| steps as u32)
    }

    #[inline(always)]
    fn link(&mut self, a: u32, b: u32) {
        if a != NONE {
            self.turned[next(a) as usize] = b;
        }
        if b != NONE {
            self.turned[next(b) as usize] = a;
        }
    }

    #[inline(always)]
    fn reverse_of(&self, h: u32) -> u32 {
        if h == NONE { NONE } else { self.turned[next(h) as usize] }
    }

    /// The half-edges `w, x, y, z` of a node.
    #[inline(always)]
    pub fn node<S: Symbols>(&mut self, symbols: S, part: &mut Part<'_>, node: u32, kin: Kin) -> S {
        let [w, x, y, z] = part.nodes[node as usize].adjacent.map(|name| name.map(HalfEdgeId::get));
        // A half-edge out of the vertex that is divided.
        let mut from = NONE;
        if kin.parent != NO_PARENT {
            let second_face = part.nodes[kin.parent as usize].has_second_face();
            let right = if second_face { 3 } else { 1 };
            from = of_node(kin.parent, if kin.is_left { 0 } else { right });
        }
        let (symbols, x) = self.outgoing(symbols, part, node, (X, from, 0), x);
        let (from, first) = if x == NONE { (from, 0) } else { (x, 1) };
        let (symbols, w) = self.incoming(symbols, part, node, (W, from, self.reverse_of(x)), w);
        let (symbols, z) = self.outgoing(symbols, part, node, (Z, from, first), z);
        let (symbols, y) = self.incoming(symbols, part, node, (Y, from, self.reverse_of(z)), y);
        if !S::WRITES {
            let mut adjacent = [None; 4];
            for (name, h) in adjacent.iter_mut().zip([w, x, y, z]) {
                *name = self.name(h, part);
            }
            part.nodes[node as usize].adjacent = adjacent;
        }
        self.link(of_node(node, 1), w);
        self.link(of_node(node, 2), x);
        if y != NONE {
            self.link(of_node(node, 0), of_node(node, 3));
            self.link(of_node(node, 4), y);
            self.link(of_node(node, 5), z);
        }
        symbols
    }

    /// One that leaves the vertex: 0 for none, 1 where it is said otherwise, then by the steps to it.
    #[inline(always)]
    fn outgoing<S: Symbols>(
        &mut self,
        mut symbols: S,
        part: &Part<'_>,
        node: u32,
        (table, from, first): (usize, u32, u32),
        wanted: Option<u32>,
    ) -> (S, u32) {
        let mut symbol = 0;
        if S::WRITES
            && let Some(name) = wanted
        {
            let h = self.find(name, part);
            symbol = self.steps_to(from, first, h).map_or(1, |steps| steps + 2);
        }
        match symbols.symbol(table, symbol) {
            0 => (symbols, NONE),
            1 => self.far(symbols, part, node, wanted),
            symbol => {
                let h = self.go_round(from, symbol - 2 + first);
                self.is_bad |= h == NONE;
                (symbols, h)
            }
        }
    }

    /// One that ends at the vertex: 0 for the one that is expected, 1 for none, 2 where it is said otherwise, then by the
    /// steps to the one after it in its face.
    #[inline(always)]
    fn incoming<S: Symbols>(
        &mut self,
        mut symbols: S,
        part: &Part<'_>,
        node: u32,
        (table, from, expected): (usize, u32, u32),
        wanted: Option<u32>,
    ) -> (S, u32) {
        let mut symbol = 0;
        if S::WRITES {
            let h = wanted.map_or(NONE, |name| self.find(name, part));
            symbol = match wanted {
                None => u32::from(expected != NONE),
                Some(_) if h == NONE => 2,
                Some(_) if h == expected => 0,
                Some(_) => self.steps_to(from, 0, next(h)).map_or(2, |steps| steps + 3),
            };
        }
        match symbols.symbol(table, symbol) {
            0 => (symbols, expected),
            1 => (symbols, NONE),
            2 => self.far(symbols, part, node, wanted),
            symbol => {
                let h = self.go_round(from, symbol - 3);
                self.is_bad |= h == NONE;
                (symbols, if h == NONE { NONE } else { prev(h) })
            }
        }
    }

    /// One that no steps lead to: of a node of the page, of a face outside that was named before, of a node outside, or of
    /// the coarsest mesh.
    #[inline(never)]
    fn far<S: Symbols>(
        &mut self,
        mut symbols: S,
        part: &Part<'_>,
        node: u32,
        wanted: Option<u32>,
    ) -> (S, u32) {
        let names = part.context.names;
        let name = wanted.unwrap_or(0);
        let found = if S::WRITES { self.find(name, part) } else { NONE };
        let (id, k) = match names.resolve(HalfEdgeId::new(name)) {
            HalfEdgeName::Base(_) => (None, 0),
            HalfEdgeName::Node(id, k) => (Some(id), k),
        };
        let kind = match (found, id) {
            (NONE, Some(_)) => 2,
            (NONE, None) => 3,
            (h, _) => u32::from(h >> 2 >= self.first_outside),
        };
        let h = match symbols.symbol(KIND, kind) {
            0 => {
                let distance = i64::from(found >> 3) - i64::from(node);
                let owner = i64::from(node).wrapping_add(symbols.signed(INSIDE, distance));
                let k = symbols.symbol(CORNER, k);
                let is_there = owner >= 0 && owner < part.nodes.len() as i64 && k < 6;
                if is_there { of_node(owner as u32, k) } else { NONE }
            }
            1 => {
                let last = (self.first_outside + self.outside.len() as u32).wrapping_sub(1);
                let back = symbols.value(KNOWN, last.wrapping_sub(found >> 2).into());
                let corner = symbols.symbol(CORNER, found & 3);
                let is_there = back < self.outside.len() as u64 && corner < 3;
                if is_there { 4 * (last - back as u32) + corner } else { NONE }
            }
            2 => {
                let last = i64::from(self.last_outside);
                let distance = id.map_or(0, |id| i64::from(id.get()) - last);
                let id = last.wrapping_add(symbols.signed(OUTSIDE, distance));
                let k = symbols.symbol(CORNER, k);
                if (0..=i64::from(names.max_node().get())).contains(&id) && k < 6 {
                    self.last_outside = id as u32;
                    let first = names.of_node(NodeId::new(id as u32), k / 3 * 3);
                    self.take_outside::<S>(first.get(), k % 3)
                } else {
                    NONE
                }
            }
            3 => {
                let last = i64::from(self.last_base);
                let name = last.wrapping_add(symbols.signed(BASE, i64::from(name) - last));
                if (0..i64::from(part.context.num_base_half_edges)).contains(&name) {
                    self.last_base = name as u32;
                    self.take_outside::<S>(name as u32 / 3 * 3, name as u32 % 3)
                } else {
                    NONE
                }
            }
            _ => NONE,
        };
        self.is_bad |= h == NONE;
        (symbols, h)
    }

    /// Takes a face outside the page among those that are known, and returns a half-edge of it.
    fn take_outside<S: Symbols>(&mut self, first: u32, corner: u32) -> u32 {
        let place = self.first_outside + self.outside.len() as u32;
        self.outside.push(first);
        self.turned.extend([NONE; 4]);
        if S::WRITES {
            self.outside_of.insert(first, place);
        }
        4 * place + corner
    }

    /// The half-edge of this name, if it is known.
    fn find(&self, name: u32, part: &Part<'_>) -> u32 {
        let first = match part.context.names.resolve(HalfEdgeId::new(name)) {
            HalfEdgeName::Base(h) => h / 3 * 3,
            HalfEdgeName::Node(id, k) => {
                if let Some(node) = part.node(id) {
                    return of_node(node, k);
                }
                name - k % 3
            }
        };
        self.outside_of.get(&first).map_or(NONE, |place| 4 * place + (name - first))
    }

    /// The name of a half-edge, if there can be one.
    #[inline(always)]
    fn name(&mut self, h: u32, part: &Part<'_>) -> Option<HalfEdgeId> {
        let (place, corner) = (h >> 2, h & 3);
        if place < self.first_outside {
            let id = part.ids[place as usize >> 1];
            return Some(part.context.names.of_node(id, 3 * (place & 1) + corner));
        }
        if h == NONE {
            return None;
        }
        let name = self.outside[(place - self.first_outside) as usize] + corner;
        let name = part.context.half_edge(name.into());
        self.is_bad |= name.is_none();
        name
    }
}
