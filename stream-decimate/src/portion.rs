//! The in-core portion of the mesh (Wu and Kobbelt 2003, §4: the part B).

mod saved;

use glam::Vec3;
use mesh_io::Colour;
use qem::Quadric;
use rayon::prelude::*;
pub(crate) use saved::Limits;

use crate::names::{Identity, Names};
use crate::paint::{self, Paint};
use crate::sealed::Sealed;
use crate::star::{StarSlice, Stars};

/// What a vertex is to the decimation. The states are bits, to be tested for several at once.
pub(crate) mod state {
    /// Not in use.
    pub(crate) const FREE: u8 = 0;
    /// Triangles may still come: on P_ab.
    pub(crate) const OPEN: u8 = 1;
    /// Surrounded by its triangles.
    pub(crate) const RING: u8 = 2;
    /// On a true boundary.
    pub(crate) const BOUNDARY: u8 = 4;
    /// Written out with one of its triangles, and fixed by that: on P_bc.
    pub(crate) const FROZEN: u8 = 8;

    /// May go, if its neighbour may take it.
    pub(crate) const MAY_GO: u8 = RING | BOUNDARY;
    /// May take a neighbour.
    pub(crate) const MAY_TAKE: u8 = RING | BOUNDARY | FROZEN;
}

/// There is no rating.
pub(crate) const STALE: u8 = 16;
/// The rating is older than the neighbourhood: the target may cost more by now, or be forbidden.
pub(crate) const UNSURE: u8 = 32;
/// It has taken another vertex in this sweep.
pub(crate) const TAKEN: u8 = 64;
/// The bound is of collapses that leave the neighbour in its place, which may cost more than others.
pub(crate) const ROUGH: u8 = 128;
/// The bound of a vertex of which nothing is known yet.
pub(crate) const UNRATED: f32 = 0.0;
/// The bits of the state.
const STATE: u8 = 15;

/// What belongs to one vertex: a cache line.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
pub(crate) struct Vertex {
    /// Where it is.
    pub(crate) position: Vec3,
    /// The planes it stands for, about its position.
    pub(crate) quadric: Quadric,
    /// The neighbour it would best be collapsed into, when last rated.
    pub(crate) target: u32,
    /// At most the cost of collapsing it into any other neighbour.
    pub(crate) second: f32,
    /// At most how far the surface around it has moved.
    pub(crate) deviation: f32,
}

/// The vertices from `base` on, with all that belongs to them: what one thread can work on alone.
#[derive(Debug)]
pub(crate) struct Window<'a> {
    base: u32,
    vertices: &'a mut [Vertex],
    pub(crate) stars: StarSlice<'a>,
    flags: &'a mut [u8],
    bounds: &'a mut [f32],
    /// Of each vertex, or of none.
    identities: &'a mut [Identity],
    /// Of each vertex, or of none.
    paints: &'a mut [Paint],
    colour_scale: f32,
}

impl Window<'_> {
    /// Whether the vertex is in this window.
    #[inline]
    pub(crate) fn has(&self, v: u32) -> bool {
        ((v.wrapping_sub(self.base)) as usize) < self.vertices.len()
    }

    /// Whether the vertex and its neighbours are in this window, and few enough.
    #[inline]
    pub(crate) fn has_star(&self, v: u32) -> bool {
        !self.stars.is_long(self.stars.valence(v))
            && self.stars.fans(v).neighbours().all(|x| self.has(x))
    }

    /// Reads all of it once, from the first vertex to the last: much faster than to have each vertex come to the caches
    /// when its turn is.
    pub(crate) fn warm(&self) {
        let vertices = self.vertices.iter().fold(0, |sum: u32, v| sum.wrapping_add(v.target));
        std::hint::black_box(vertices.wrapping_add(self.stars.sum_of_lengths()));
    }

    /// The number of the first vertex.
    pub(crate) fn base(&self) -> u32 {
        self.base
    }

    /// The numbers of its vertices.
    pub(crate) fn range(&self) -> std::ops::Range<u32> {
        self.base..self.base + self.vertices.len() as u32
    }

    /// Bounds of all vertices.
    pub(crate) fn bounds(&self) -> &[f32] {
        self.bounds
    }

    #[inline]
    pub(crate) fn vertex(&self, v: u32) -> &Vertex {
        &self.vertices[(v - self.base) as usize]
    }

    #[inline]
    pub(crate) fn vertex_mut(&mut self, v: u32) -> &mut Vertex {
        &mut self.vertices[(v - self.base) as usize]
    }

    #[inline]
    pub(crate) fn position(&self, v: u32) -> Vec3 {
        self.vertex(v).position
    }

    /// Who a vertex is; collapses have to be recorded.
    #[inline]
    pub(crate) fn identity(&self, v: u32) -> &Identity {
        &self.identities[(v - self.base) as usize]
    }

    #[inline]
    pub(crate) fn identity_mut(&mut self, v: u32) -> &mut Identity {
        &mut self.identities[(v - self.base) as usize]
    }

    /// The colour of a vertex, if vertices have colours.
    pub(crate) fn colour(&self, v: u32) -> Option<Colour> {
        self.paints.get((v - self.base) as usize).map(|paint| paint.colour)
    }

    /// Whether the errors of colours count.
    #[inline]
    pub(crate) fn has_colour_costs(&self) -> bool {
        self.colour_scale > 0.0
    }

    /// What collapsing `v` into `u` costs because of their colours; only where that [counts](Self::has_colour_costs).
    pub(crate) fn colour_cost(&self, v: u32, u: u32) -> f32 {
        self.colour_scale * paint::error(self, v, u)
    }

    /// The paint of a vertex; only where vertices have colours.
    #[inline]
    pub(crate) fn paint(&self, v: u32) -> &Paint {
        &self.paints[(v - self.base) as usize]
    }

    /// Gives `u` what `v` stands for, if vertices have colours.
    pub(crate) fn take_paint(&mut self, v: u32, u: u32) {
        let from = self.paints.get((v - self.base) as usize).copied();
        if let (Some(from), Some(to)) = (from, self.paints.get_mut((u - self.base) as usize)) {
            to.add_area(from.area);
        }
    }

    #[inline]
    pub(crate) fn flags(&self, v: u32) -> u8 {
        self.flags[(v - self.base) as usize]
    }

    #[inline]
    pub(crate) fn flags_mut(&mut self, v: u32) -> &mut u8 {
        &mut self.flags[(v - self.base) as usize]
    }

    #[inline]
    pub(crate) fn state(&self, v: u32) -> u8 {
        self.flags(v) & STATE
    }

    #[inline]
    pub(crate) fn bound(&self, v: u32) -> f32 {
        self.bounds[(v - self.base) as usize]
    }

    #[inline]
    pub(crate) fn bound_mut(&mut self, v: u32) -> &mut f32 {
        &mut self.bounds[(v - self.base) as usize]
    }
}

/// Puts items in the order given, in place: along each cycle of the permutation, each item goes to where the one before
/// was.
pub(crate) fn permute<T: Copy>(items: &mut [T], order: &[u32]) {
    let mut done = vec![false; items.len()];
    for start in 0..items.len() {
        if done[start] {
            continue;
        }
        let first = items[start];
        let mut at = start;
        loop {
            done[at] = true;
            let from = order[at] as usize;
            if from == start {
                break;
            }
            items[at] = items[from];
            at = from;
        }
        items[at] = first;
    }
}

pub(crate) fn take_front<'a, T>(slice: &mut &'a mut [T], length: usize) -> &'a mut [T] {
    let (front, rest) = std::mem::take(slice).split_at_mut(length);
    *slice = rest;
    front
}

/// Vertices and triangles of the buffer.
#[derive(Debug, Default)]
pub(crate) struct Portion {
    pub(crate) vertices: Vec<Vertex>,
    pub(crate) stars: Stars,
    /// State and marks of each vertex.
    pub(crate) flags: Vec<u8>,
    /// At most the cost of the best collapse of each vertex; infinite where there is none.
    pub(crate) bounds: Vec<f32>,
    /// What tells when an open vertex has had its last triangle.
    pub(crate) waiting: Vec<u32>,
    /// What was sealed on suspicion.
    pub(crate) sealed: Sealed,
    /// Who the vertices are, where collapses are recorded; else empty.
    pub(crate) identities: Vec<Identity>,
    /// The names they may have.
    pub(crate) names: Option<Names>,
    /// Their colours, where they have some; else empty.
    pub(crate) paints: Vec<Paint>,
    /// Whether they have.
    pub(crate) has_colours: bool,
    /// What an error of colours is multiplied with to be a cost: the square of a length; 0 where it does not count.
    pub(crate) colour_scale: f32,
    /// Vertices not in use, the first of them last.
    free: Vec<u32>,
    num_triangles: usize,
}

impl Portion {
    /// Room for so many vertices at first.
    pub(crate) fn with_capacity(vertices: usize) -> Self {
        let mut portion = Self::default();
        portion.reserve(vertices);
        portion
    }

    /// Room for so many vertices, which have names.
    pub(crate) fn with_names(vertices: usize) -> Self {
        let stars = Stars::default().with_tags();
        let mut portion = Self { names: Some(Names::default()), stars, ..Self::default() };
        portion.reserve(vertices);
        portion
    }

    /// Room for so many more vertices, and no more than that: there is not much memory beside these.
    fn reserve(&mut self, vertices: usize) {
        self.vertices.reserve_exact(vertices);
        self.flags.reserve_exact(vertices);
        self.bounds.reserve_exact(vertices);
        self.waiting.reserve_exact(vertices);
        self.stars.reserve_exact(vertices);
        if self.names.is_some() {
            self.identities.reserve_exact(vertices);
        }
        if self.has_colours {
            self.paints.reserve_exact(vertices);
        }
    }

    /// Lets vertices have colours; there are none yet.
    pub(crate) fn with_colours(mut self) -> Self {
        self.has_colours = true;
        let vertices = self.vertices.capacity();
        self.paints.reserve_exact(vertices);
        self
    }

    /// Triangles in the buffer.
    pub(crate) fn num_triangles(&self) -> usize {
        self.num_triangles
    }

    /// Slots of vertices, in use or not.
    pub(crate) fn num_slots(&self) -> usize {
        self.vertices.len()
    }

    /// Vertices in use.
    pub(crate) fn num_vertices(&self) -> usize {
        self.vertices.len() - self.free.len()
    }

    /// The state of a vertex.
    #[inline]
    pub(crate) fn state(&self, v: u32) -> u8 {
        self.flags[v as usize] & STATE
    }

    /// Changes the state, and forgets the marks.
    #[inline]
    pub(crate) fn set_state(&mut self, v: u32, state: u8) {
        self.flags[v as usize] = state;
    }

    #[inline]
    pub(crate) fn position(&self, v: u32) -> Vec3 {
        self.vertices[v as usize].position
    }

    /// A new vertex without triangles; the colour is only looked at if vertices have colours.
    pub(crate) fn add_vertex(&mut self, position: Vec3, colour: Colour) -> u32 {
        let vertex = Vertex {
            position,
            quadric: Quadric::default(),
            target: 0,
            second: 0.0,
            deviation: 0.0,
        };
        let identity = self
            .names
            .as_mut()
            .map(|names| Identity { name: names.take_vertex(), ..Default::default() });
        match self.free.pop() {
            Some(v) => {
                if let Some(identity) = identity {
                    self.identities[v as usize] = identity;
                }
                if self.has_colours {
                    self.paints[v as usize] = Paint::new(colour);
                }
                self.vertices[v as usize] = vertex;
                self.flags[v as usize] = state::OPEN;
                self.bounds[v as usize] = f32::INFINITY;
                self.waiting[v as usize] = 0;
                v
            }
            None => {
                if self.vertices.len() == self.vertices.capacity() {
                    self.reserve((self.vertices.len() / 16).max(64));
                }
                let v = self.vertices.len() as u32;
                self.vertices.push(vertex);
                self.flags.push(state::OPEN);
                self.bounds.push(f32::INFINITY);
                self.waiting.push(0);
                self.identities.extend(identity);
                if self.has_colours {
                    self.paints.push(Paint::new(colour));
                }
                self.stars.push();
                v
            }
        }
    }

    /// Forgets a vertex without triangles.
    #[inline]
    pub(crate) fn remove_vertex(&mut self, v: u32) {
        self.flags[v as usize] = state::FREE;
        self.bounds[v as usize] = f32::INFINITY;
        self.free.push(v);
    }

    /// All of it.
    pub(crate) fn whole(&mut self) -> Window<'_> {
        Window {
            base: 0,
            vertices: &mut self.vertices,
            stars: self.stars.all(),
            flags: &mut self.flags,
            bounds: &mut self.bounds,
            identities: &mut self.identities,
            paints: &mut self.paints,
            colour_scale: self.colour_scale,
        }
    }

    /// Cuts it into windows of so many vertices, the first of which has `offset` of them.
    pub(crate) fn windows(&mut self, size: usize, offset: usize) -> Vec<Window<'_>> {
        let count = self.num_slots();
        let offset = offset.min(count);
        let lengths = std::iter::once(offset)
            .chain((offset..count).step_by(size).map(|from| size.min(count - from)));
        let mut base = 0;
        let has_names = self.names.is_some();
        let (mut vertices, mut flags, mut bounds) =
            (&mut self.vertices[..], &mut self.flags[..], &mut self.bounds[..]);
        let mut identities = &mut self.identities[..];
        let (has_colours, colour_scale) = (self.has_colours, self.colour_scale);
        let mut paints = &mut self.paints[..];
        let stars = self.stars.slices(lengths.clone());
        lengths
            .zip(stars)
            .map(|(length, stars)| {
                let window = Window {
                    base,
                    vertices: take_front(&mut vertices, length),
                    stars,
                    flags: take_front(&mut flags, length),
                    bounds: take_front(&mut bounds, length),
                    identities: take_front(&mut identities, if has_names { length } else { 0 }),
                    paints: take_front(&mut paints, if has_colours { length } else { 0 }),
                    colour_scale,
                };
                base += length as u32;
                window
            })
            .collect()
    }

    /// Takes back vertices that were collapsed into others in a window, and counts the triangles that went with them.
    pub(crate) fn take_back(&mut self, collapsed: &[(u32, u32)], triangles: usize) {
        self.free.extend(collapsed.iter().map(|&(v, _)| v));
        self.sealed.collapsed(collapsed);
        self.num_triangles -= triangles;
    }

    /// Gives the vertices new numbers, in place: `order` names all slots by their old numbers, the first `used` of which
    /// are in use.
    pub(crate) fn renumber(&mut self, order: &[u32], used: usize) {
        let mut new_of = vec![u32::MAX; order.len()];
        for (new, &old) in order[..used].iter().enumerate() {
            new_of[old as usize] = new as u32;
        }
        let Self { vertices, stars, flags, bounds, waiting, identities, paints, .. } = self;
        rayon::join(
            || {
                permute(vertices, order);
                if !identities.is_empty() {
                    permute(identities, order);
                }
                if !paints.is_empty() {
                    permute(paints, order);
                }
            },
            || {
                stars.permute(order);
                *flags = order.iter().map(|&v| flags[v as usize]).collect();
                *bounds = order.iter().map(|&v| bounds[v as usize]).collect();
                *waiting = order.iter().map(|&v| waiting[v as usize]).collect();
            },
        );
        self.rename(&new_of, used);
    }

    /// Keeps the first `used` slots, and puts new numbers into them.
    fn rename(&mut self, new_of: &[u32], used: usize) {
        self.vertices.truncate(used);
        self.flags.truncate(used);
        self.bounds.truncate(used);
        self.waiting.truncate(used);
        self.identities.truncate(used);
        self.paints.truncate(used);
        self.vertices.par_iter_mut().with_min_len(4096).for_each(|vertex| {
            // A target that has gone was forgotten with its rating.
            vertex.target = new_of.get(vertex.target as usize).copied().unwrap_or(u32::MAX);
        });
        self.stars.renumber(new_of, used);
        self.sealed.renumber(|v| Some(new_of[v as usize]).filter(|&new| new != u32::MAX));
        self.free.clear();
    }

    /// Gives the vertices new numbers without gaps, in the order that they have.
    pub(crate) fn compact(&mut self) {
        let mut new_of = vec![u32::MAX; self.num_slots()];
        let mut used = 0;
        for (old, new) in new_of.iter_mut().enumerate() {
            if self.flags[old] == state::FREE {
                continue;
            }
            *new = used as u32;
            if used != old {
                self.vertices[used] = self.vertices[old];
                self.flags[used] = self.flags[old];
                self.bounds[used] = self.bounds[old];
                self.waiting[used] = self.waiting[old];
                if let Some(&identity) = self.identities.get(old) {
                    self.identities[used] = identity;
                }
                if let Some(&paint) = self.paints.get(old) {
                    self.paints[used] = paint;
                }
                self.stars.swap(used, old);
            }
            used += 1;
        }
        self.rename(&new_of, used);
    }

    /// Follows the vertices that were sealed on suspicion to what they have become, as far as that is a boundary.
    pub(crate) fn follow_sealed(&mut self) {
        let flags = &self.flags;
        let on_boundary = |v: u32| flags[v as usize] & (state::BOUNDARY | state::OPEN) != 0;
        self.sealed.renumber(|v| Some(v).filter(|&v| on_boundary(v)));
    }

    /// Counts triangles that came or went.
    #[inline]
    pub(crate) fn count_triangles(&mut self, come: usize, gone: usize) {
        self.num_triangles = self.num_triangles + come - gone;
    }

    /// Adds a plane through the vertex to those it stands for.
    #[inline]
    pub(crate) fn add_plane(&mut self, v: u32, plane: &Quadric) {
        self.vertices[v as usize].quadric.merge_plane(plane);
    }

    /// Lets a boundary vertex wait for triangles again.
    pub(crate) fn reopen(&mut self, v: u32) {
        self.set_state(v, state::OPEN);
        self.bounds[v as usize] = f32::INFINITY;
        for x in self.stars.fans(v).neighbours() {
            self.flags[x as usize] |= UNSURE;
        }
    }

    /// Triangles with an open corner.
    pub(crate) fn num_waiting_triangles(&self) -> usize {
        let open = |v: u32| self.state(v) == state::OPEN;
        (0..self.num_slots() as u32)
            .filter(|&v| open(v))
            .map(|v| {
                let fans = self.stars.fans(v);
                // Counted at the first of its open corners.
                fans.triangles().filter(|&(a, b)| !(a < v && open(a) || b < v && open(b))).count()
            })
            .sum()
    }

    /// Makes candidates of the vertices that have become complete, and again of those that could not go before.
    pub(crate) fn settle(&mut self) {
        for (flags, bound) in self.flags.iter_mut().zip(&mut self.bounds) {
            if *flags & state::MAY_GO != 0 && *bound == f32::INFINITY {
                *flags |= STALE;
                *bound = UNRATED;
            }
        }
        for (identity, flags) in self.identities.iter_mut().zip(&self.flags) {
            if flags & state::MAY_GO != 0 && identity.mean == Vec3::ZERO {
                identity.mean = identity.normal.normalize_or_zero();
            }
        }
    }

    /// Sets what the errors of colours cost: as much as if the surface had moved by `weight` times the diagonal of the bounding
    /// box of what is there, where it has moved by all of one component. Ratings that are older are forgotten.
    pub(crate) fn scale_colours(&mut self, weight: f32) {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        if self.has_colours && weight > 0.0 {
            let used = self.flags.iter().map(|flags| flags & STATE != state::FREE);
            for (vertex, _) in self.vertices.iter().zip(used).filter(|&(_, used)| used) {
                (low, high) = (low.min(vertex.position), high.max(vertex.position));
            }
        }
        let length = if low.cmple(high).all() { weight * low.distance(high) } else { 0.0 };
        let scale = length * length;
        if scale != self.colour_scale {
            self.colour_scale = scale;
            for (flags, bound) in self.flags.iter().zip(&mut self.bounds) {
                if *flags & state::MAY_GO != 0 {
                    *bound = UNRATED;
                }
            }
        }
    }

    /// Forgets the ratings of the neighbours of a vertex: what they would be collapsed into may not be beside them any more.
    pub(crate) fn unrate_around(&mut self, v: u32) {
        for x in self.stars.fans(v).neighbours() {
            let flags = &mut self.flags[x as usize];
            if *flags & state::MAY_GO != 0 {
                *flags |= STALE;
                self.bounds[x as usize] = UNRATED;
            }
        }
    }

    /// That all corners of a triangle have half-edges of the same face, if they have tags.
    #[cfg(test)]
    fn validate_tags(&self, v: u32) -> Result<(), String> {
        let fans = self.stars.fans(v);
        for (i, &h) in self.stars.tags(v).iter().enumerate().filter(|&(i, _)| !fans.is_last(i)) {
            let x = fans.at(i);
            let there = self.stars.fans(x);
            let y = fans.at((i + 1) % fans.len());
            let at = there.position(y).ok_or(format!("triangle {v} {x} {y} is unknown to {x}"))?;
            let next = self.stars.tags(x)[at];
            if next != h / 3 * 3 + (h + 1) % 3 {
                return Err(format!("triangle {v} {x} {y}: half-edge {h} is followed by {next}"));
            }
        }
        Ok(())
    }

    /// Checks every invariant.
    #[cfg(test)]
    pub(crate) fn validate(&self) -> Result<(), String> {
        use std::collections::HashSet;
        let mut triangles = HashSet::new();
        for v in 0..self.num_slots() as u32 {
            let fans = self.stars.fans(v);
            let state = self.state(v);
            if state == state::FREE {
                if fans.len() > 0 {
                    return Err(format!("vertex {v} is free and has triangles"));
                }
                continue;
            }
            if fans.len() == 0 {
                return Err(format!("vertex {v} has no triangles"));
            }
            if (state == state::RING) != fans.is_ring() {
                return Err(format!("vertex {v} is in state {state}, ring: {}", fans.is_ring()));
            }
            if state == state::BOUNDARY && fans.num_fans() != 1 {
                return Err(format!("boundary vertex {v} has {} fans", fans.num_fans()));
            }
            let distinct: HashSet<u32> = fans.neighbours().collect();
            if distinct.len() != fans.len() || distinct.contains(&v) {
                return Err(format!("the neighbours of vertex {v} are not distinct"));
            }
            for (a, b) in fans.triangles() {
                for [p, q, r] in [[a, b, v], [b, v, a]] {
                    if !self.stars.fans(p).has_triangle(q, r) {
                        return Err(format!("triangle {v} {a} {b} is unknown to vertex {p}"));
                    }
                }
                triangles.insert([v, a, b]);
            }
            self.validate_tags(v)?;
        }
        if triangles.len() != 3 * self.num_triangles {
            return Err(format!("{} corners, {} triangles", triangles.len(), self.num_triangles));
        }
        Ok(())
    }
}
