//! READ (Wu and Kobbelt 2003, §4.2): triangles find their neighbours by the coordinates of their corners.

use glam::Vec3;
use mesh_io::{Colour, Triangle};
use qem::{ErrorMetric, Quadric};

use crate::Repairs;
use crate::lookup::{Lookup, key};
use crate::names::normal_at;
use crate::paint::Paint;
use crate::portion::{Portion, state};
use crate::sealed::Trace;
use crate::star::{Added, Joint};

/// A vertex that is known to have had its last triangle waits for nothing.
pub(crate) const NOTHING: u32 = u32::MAX;

/// Colours of a triangle without any.
const UNCOLOURED: [Colour; 3] = [[255; 4]; 3];

/// The clock of the waiting vertices ticks once in so many triangles.
const TICK: u64 = 64;

/// What the clock of the waiting vertices shows after so many triangles.
pub(crate) fn clock(read: u64) -> u32 {
    (read / TICK) as u32
}

/// Puts triangles into the portion.
#[derive(Debug, Default)]
pub(crate) struct Inserter {
    lookup: Lookup,
    pub(crate) repairs: Repairs,
}

impl Inserter {
    /// Forgets all vertices but those whose triangles may still come, and lets their number be `expected` more.
    pub(crate) fn begin(&mut self, portion: &mut Portion, expected: usize) {
        portion.compact();
        portion.follow_sealed();
        self.lookup.reset(expected);
        for v in 0..portion.num_slots() as u32 {
            if portion.state(v) == state::OPEN {
                self.lookup.insert(portion.position(v), v);
            }
        }
    }

    /// Puts triangles where they belong, before which `first` have been read. Of each, `last` tells the corners that are the
    /// last ones of their vertices, if it is not empty; and so `colours` their colours.
    pub(crate) fn insert_all(
        &mut self,
        portion: &mut Portion,
        triangles: &[Triangle],
        colours: &[[Colour; 3]],
        last: &[u8],
        first: u64,
    ) {
        for (i, (triangle, number)) in triangles.iter().zip(first + 1..).enumerate() {
            let colours = colours.get(i).copied().unwrap_or(UNCOLOURED);
            let inserted = self.insert(portion, triangle, colours);
            for v in inserted.into_iter().flatten() {
                portion.waiting[v as usize] = clock(number);
            }
            let tag = last.get(i).copied().unwrap_or(0);
            for corner in (0..3).filter(|corner| tag >> corner & 1 != 0) {
                let last = match inserted {
                    Some(vertices) => Some(vertices[corner]),
                    None => self.find(portion, triangle[corner]),
                };
                if let Some(v) = last {
                    portion.waiting[v as usize] = NOTHING;
                }
            }
        }
    }

    /// Seals the vertices that are known to have had their last triangle: those that were told, and those `below` a
    /// coordinate on an axis.
    pub(crate) fn seal_final(&mut self, portion: &mut Portion, below: Option<(usize, f32)>) {
        for v in 0..portion.num_slots() as u32 {
            if portion.state(v) != state::OPEN {
                continue;
            }
            let position = portion.position(v);
            let is_below = below.is_some_and(|(axis, coordinate)| position[axis] < coordinate);
            if is_below || portion.waiting[v as usize] == NOTHING {
                self.seal(portion, v);
            }
        }
    }

    /// Forgets all vertices: no triangle will come any more.
    pub(crate) fn forget(&mut self) {
        self.lookup = Lookup::default();
    }

    /// Puts a triangle where it belongs; its vertices, if it did not have to be left out.
    fn insert(
        &mut self,
        portion: &mut Portion,
        triangle: &Triangle,
        colours: [Colour; 3],
    ) -> Option<[u32; 3]> {
        // Adding zero makes −0 equal to +0.
        let corners = triangle.map(|corner| corner + Vec3::ZERO);
        if !corners.iter().all(|c| c.is_finite()) {
            self.repairs.non_finite += 1;
            return None;
        }
        let [p, q, r] = corners;
        if p == q || q == r || r == p {
            self.repairs.degenerate += 1;
            return None;
        }
        let found = corners.map(|corner| self.lookup.find(corner, |v| portion.position(v)));
        let found =
            if portion.sealed.is_empty() { found } else { self.trace(portion, corners, found)? };
        let (vertices, joints) = match joints(portion, found) {
            Some(joints) => (self.vertices(portion, found, corners, colours), joints),
            None => {
                let vertices = self.cut_off(portion, corners, colours)?;
                (vertices, joints(portion, vertices.map(Some))?)
            }
        };
        for v in vertices {
            if portion.state(v) == state::BOUNDARY {
                portion.reopen(v);
            }
        }
        if portion.has_colours {
            self.compare_colours(portion, vertices, colours);
        }
        portion.count_triangles(1, 0);
        let cross = (q - p).cross(r - p);
        let plane = Quadric::from_cross_product(cross);
        let [a, b, c] = vertices;
        let half_edge = match &mut portion.names {
            Some(names) => {
                let turns = [[p, q, r], [q, r, p], [r, p, q]];
                for (v, turn) in vertices.into_iter().zip(turns) {
                    portion.identities[v as usize].normal += normal_at(turn, cross);
                }
                3 * names.take_face()
            }
            None => 0,
        };
        let corners = [(a, b, c), (b, c, a), (c, a, b)].into_iter().zip(joints);
        for (((v, x, y), joint), tag) in corners.zip(half_edge..) {
            portion.add_plane(v, &plane);
            if let Some(paint) = portion.paints.get_mut(v as usize) {
                paint.add_area(0.5 * cross.length());
            }
            match portion.stars.all().add(v, x, y, joint, tag) {
                Added::Open => portion.set_state(v, state::OPEN),
                Added::Ring => {
                    portion.set_state(v, state::RING);
                }
                Added::RingAndOthers => {
                    self.split(portion, v);
                    portion.set_state(v, state::RING);
                }
            }
        }
        Some(vertices)
    }

    /// As [`insert`](Self::insert) found the corners, with vertices that were sealed before this triangle came. `None` if
    /// nothing is left of it.
    fn trace(
        &mut self,
        portion: &Portion,
        corners: Triangle,
        mut found: [Option<u32>; 3],
    ) -> Option<[Option<u32>; 3]> {
        let mut late = false;
        let mut crack = false;
        for (found, corner) in found.iter_mut().zip(corners).filter(|(found, _)| found.is_none()) {
            match portion.sealed.trace(corner) {
                Trace::None => {}
                Trace::Vertex(v) => {
                    late = true;
                    *found = Some(v);
                }
                Trace::Gone => crack = true,
            }
        }
        let [a, b, c] = found;
        let same = |x: Option<u32>, y: Option<u32>| x.is_some() && x == y;
        let nothing_left = same(a, b) || same(b, c) || same(c, a);
        if late && !nothing_left && joints(portion, found).is_none() {
            crack = true;
            late = false;
        }
        self.repairs.late += u64::from(late && !crack);
        self.repairs.late_cracks += u64::from(crack);
        (!nothing_left).then_some(found)
    }

    /// The vertex at a position whose triangles may still come.
    fn find(&mut self, portion: &Portion, position: Vec3) -> Option<u32> {
        self.lookup.find(position + Vec3::ZERO, |v| portion.position(v))
    }

    /// Those that were found, and new ones where there are none.
    #[inline]
    fn vertices(
        &mut self,
        portion: &mut Portion,
        found: [Option<u32>; 3],
        corners: Triangle,
        colours: [Colour; 3],
    ) -> [u32; 3] {
        let mut vertices = [0; 3];
        let corners = corners.into_iter().zip(colours);
        for ((vertex, found), (corner, colour)) in vertices.iter_mut().zip(found).zip(corners) {
            *vertex = found.unwrap_or_else(|| self.new_vertex(portion, corner, colour));
        }
        vertices
    }

    /// Counts the corners whose vertices have other colours already.
    fn compare_colours(&mut self, portion: &Portion, vertices: [u32; 3], colours: [Colour; 3]) {
        let corners = vertices.into_iter().zip(colours);
        let differ = |&(v, colour): &(u32, Colour)| portion.paints[v as usize].colour != colour;
        self.repairs.recoloured += corners.filter(differ).count() as u64;
    }

    fn new_vertex(&mut self, portion: &mut Portion, position: Vec3, colour: Colour) -> u32 {
        let v = portion.add_vertex(position, colour);
        self.lookup.insert(position, v);
        v
    }

    /// The vertices of a triangle one of whose edges has its triangles already: of all vertices at its corners, those
    /// that join it to the most neighbours, and new ones where none fits. `None` if it is there already.
    fn cut_off(
        &mut self,
        portion: &mut Portion,
        corners: Triangle,
        colours: [Colour; 3],
    ) -> Option<[u32; 3]> {
        let mut choices: [Vec<Option<u32>>; 3] = Default::default();
        for (choice, &corner) in choices.iter_mut().zip(&corners) {
            let all = self.lookup.find_all(key(corner), |v| portion.position(v) == corner);
            choice.extend(all.map(Some));
            choice.push(None);
        }
        let mut best: Option<(usize, [Option<u32>; 3])> = None;
        let [of_p, of_q, of_r] = &choices;
        for &a in of_p {
            for &b in of_q {
                for &c in of_r {
                    if let (Some(a), Some(b), Some(c)) = (a, b, c)
                        && portion.stars.fans(a).has_triangle(b, c)
                    {
                        self.repairs.duplicate += 1;
                        return None;
                    }
                    let complete =
                        |v: Option<u32>| v.is_some_and(|v| portion.state(v) == state::RING);
                    if complete(a) || complete(b) || complete(c) {
                        continue;
                    }
                    let edges = [(a, b), (b, c), (c, a)];
                    let both = |e: (Option<u32>, Option<u32>)| e.0.zip(e.1);
                    if edges.into_iter().filter_map(both).any(|(x, y)| leads(portion, x, y)) {
                        continue;
                    }
                    let joined = edges
                        .into_iter()
                        .filter_map(both)
                        .filter(|&(x, y)| leads(portion, y, x))
                        .count();
                    if best.is_none_or(|(most, _)| joined > most) {
                        best = Some((joined, [a, b, c]));
                    }
                }
            }
        }
        self.repairs.non_manifold += 1;
        let (_, chosen) = best?;
        Some(self.vertices(portion, chosen, corners, colours))
    }

    /// Gives all fans of a vertex but the last to a vertex of their own, which is open.
    fn split(&mut self, portion: &mut Portion, v: u32) -> u32 {
        self.repairs.split_vertices += 1;
        let fans = portion.stars.all().take_all_but_last(v);
        let position = portion.position(v);
        let colour = portion.paints.get(v as usize).map_or(UNCOLOURED[0], |paint| paint.colour);
        let other = self.new_vertex(portion, position, colour);
        portion.stars.all().adopt(other, v, &fans);
        // Of what its triangles have been through it knows as much as the other.
        if let Some(touched) = portion.identities.get(v as usize).map(|identity| identity.touched) {
            portion.identities[other as usize].touched = touched;
        }
        for vertex in [v, other] {
            let mut quadric = Quadric::default();
            let mut normal = Vec3::ZERO;
            let mut paint =
                portion.paints.get(vertex as usize).map(|paint| Paint::new(paint.colour));
            for (a, b) in portion.stars.fans(vertex).triangles() {
                let [a, b] = [a, b].map(|x| portion.position(x) - position);
                quadric.merge(&Quadric::from_triangle([Vec3::ZERO, a, b]));
                normal += normal_at([Vec3::ZERO, a, b], a.cross(b));
                if let Some(paint) = &mut paint {
                    paint.add_area(0.5 * a.cross(b).length());
                }
            }
            portion.vertices[vertex as usize].quadric = quadric;
            if let Some(identity) = portion.identities.get_mut(vertex as usize) {
                identity.normal = normal;
            }
            if let Some(paint) = paint {
                portion.paints[vertex as usize] = paint;
            }
        }
        portion.waiting[other as usize] = portion.waiting[v as usize];
        portion.unrate_around(other);
        other
    }

    /// Takes an open vertex for one that has all its triangles: each fan becomes part of a true boundary.
    pub(crate) fn seal(&mut self, portion: &mut Portion, v: u32) {
        while portion.stars.fans(v).num_fans() > 1 {
            let mut rest = self.split(portion, v);
            while portion.stars.fans(rest).num_fans() > 1 {
                rest = self.split_one(portion, rest);
            }
            self.seal_fan(portion, rest);
        }
        self.seal_fan(portion, v);
    }

    fn split_one(&mut self, portion: &mut Portion, v: u32) -> u32 {
        let other = self.split(portion, v);
        self.seal_fan(portion, v);
        other
    }

    fn seal_fan(&mut self, portion: &mut Portion, v: u32) {
        let fans = portion.stars.fans(v);
        let position = portion.position(v);
        let mut quadric = Quadric::default();
        let list: Vec<(u32, u32)> = fans.triangles().collect();
        if let (Some(&(x, next)), Some(&(previous, y))) = (list.first(), list.last()) {
            for (end, third) in [(x, next), (y, previous)] {
                let [end, third] = [end, third].map(|x| portion.position(x) - position);
                let normal = end.cross(third).normalize_or_zero();
                quadric.merge(&Quadric::from_boundary_edge([Vec3::ZERO, end], normal));
            }
        }
        portion.add_plane(v, &quadric);
        portion.set_state(v, state::BOUNDARY);
    }
}

/// Where a triangle joins the fans of its vertices, as far as they are there; `None` if it does not fit.
#[inline]
fn joints(portion: &Portion, found: [Option<u32>; 3]) -> Option<[Joint; 3]> {
    // No vertex has this number.
    let [a, b, c] = found.map(|v| v.unwrap_or(u32::MAX >> 1));
    let mut joints = [Joint::default(); 3];
    for (joint, (v, x, y)) in joints.iter_mut().zip([(a, b, c), (b, c, a), (c, a, b)]) {
        if v != u32::MAX >> 1 {
            if portion.state(v) == state::RING {
                return None;
            }
            *joint = portion.stars.fans(v).joint(x, y)?;
        }
    }
    Some(joints)
}

/// Whether the edge from `a` to `b` has its triangle.
#[inline]
fn leads(portion: &Portion, a: u32, b: u32) -> bool {
    portion.stars.fans(a).leads_to(b)
}
