//! What a collapse does to the triangles around it.

use glam::Vec3;
use halfedge::{Collapse, HalfEdgeMesh};

use crate::{OctNormal, StarBounds};

/// Cosine of the largest angle a triangle may turn by in one collapse, about 75 degrees.
const MIN_TURN_COSINE: f32 = 0.25;

/// A mesh with positions and normals, as the builder looks at it.
#[derive(Clone, Copy)]
pub(crate) struct Surface<'a> {
    pub(crate) mesh: &'a HalfEdgeMesh,
    pub(crate) positions: &'a [Vec3],
    pub(crate) normals: &'a [OctNormal],
}

/// Twice the area of a triangle along its normal.
#[inline]
pub(crate) fn area_normal([a, b, c]: [Vec3; 3]) -> Vec3 {
    (b - a).cross(c - a)
}

impl Surface<'_> {
    /// The triangles that stay but lose the removed vertex for the kept one: their other two corners.
    fn moved_triangles(&self, c: &Collapse) -> impl Iterator<Item = [usize; 2]> + '_ {
        let gone = [Some(c.half_edge.face()), c.reverse.map(|h| h.face())];
        self.mesh
            .outgoing(c.removed)
            .filter(move |h| !gone.contains(&Some(h.face())))
            .map(|h| [self.mesh.end(h).index(), self.mesh.start(h.prev()).index()])
    }

    /// Whether no triangle is turned over, neither against how it lay before nor against the surface, whose normals its
    /// corners carry.
    pub(crate) fn keeps_orientation(&self, c: &Collapse) -> bool {
        let (v, u) = (c.removed.index(), c.kept.index());
        self.moved_triangles(c).all(|[r, s]| {
            let [pv, pu, pr, ps] = [v, u, r, s].map(|i| self.positions[i]);
            let before = area_normal([pv, pr, ps]);
            let after = area_normal([pu, pr, ps]);
            let surface = |i: usize| self.normals[i].to_vec3();
            let (length_before, length_after) = (before.length(), after.length());
            if length_before == 0.0 {
                // A triangle without area has no side to be turned from.
                return true;
            }
            let beside = surface(r) + surface(s);
            after.dot(before) > MIN_TURN_COSINE * length_before * length_after
                && (after.dot(beside + surface(u)) > 0.0 || before.dot(beside + surface(v)) <= 0.0)
        })
    }

    /// Bounds of the star of the removed vertex. `earlier` is the deviation of what was merged there before.
    pub(crate) fn star_bounds(&self, c: &Collapse, earlier: f32) -> StarBounds {
        let (v, u) = (c.removed.index(), c.kept.index());
        let axis = self.normals[v].to_vec3();
        let mut radius = 0.0f32;
        let mut min_cosine = 1.0f32;
        let mut widen = |triangle: [Vec3; 3]| {
            let normal = area_normal(triangle);
            let length = normal.length();
            if length > 0.0 {
                min_cosine = min_cosine.min(normal.dot(axis) / length);
            }
        };
        for triangle in self.star(c) {
            let [center, r, s] = triangle;
            radius = radius.max(r.distance(center)).max(s.distance(center));
            widen(triangle);
        }
        for corners in self.moved_triangles(c) {
            widen(self.triangle(u, corners));
        }
        StarBounds {
            radius,
            cone_angle: min_cosine.clamp(-1.0, 1.0).acos(),
            deviation: earlier + self.moved_by(c),
        }
    }

    fn triangle(&self, apex: usize, [r, s]: [usize; 2]) -> [Vec3; 3] {
        [apex, r, s].map(|i| self.positions[i])
    }

    /// The triangles around the removed vertex.
    fn star(&self, c: &Collapse) -> impl Iterator<Item = [Vec3; 3]> + '_ {
        let v = c.removed.index();
        self.mesh.outgoing(c.removed).map(move |h| {
            let [r, s] = [self.mesh.end(h), self.mesh.start(h.prev())].map(|r| r.index());
            self.triangle(v, [r, s])
        })
    }

    /// How far the surface moves, both ways: from the vertex that goes to the triangles after, and from the middles of
    /// the edges that are new to the triangles before. There two triangulations of one hole lie farthest apart.
    fn moved_by(&self, c: &Collapse) -> f32 {
        let (v, u) = (self.positions[c.removed.index()], self.positions[c.kept.index()]);
        let mut forth = f32::INFINITY;
        // The removed faces shrink to the edges from u to their third corners.
        for h in [Some(c.half_edge), c.reverse].into_iter().flatten() {
            let corner = self.positions[self.mesh.start(h.prev()).index()];
            forth = forth.min(distance_to_segment(v, u, corner));
        }
        for corners in self.moved_triangles(c) {
            forth = forth.min(distance_to_triangle(v, self.triangle(c.kept.index(), corners)));
        }
        let back = self
            .mesh
            .one_ring(c.removed)
            .filter(|&r| r != c.kept)
            .map(|r| {
                let middle = 0.5 * (u + self.positions[r.index()]);
                self.star(c).map(|t| distance_to_triangle(middle, t)).fold(f32::INFINITY, f32::min)
            })
            .fold(0.0, f32::max);
        forth.max(back)
    }
}

fn distance_to_segment(p: Vec3, a: Vec3, b: Vec3) -> f32 {
    let ab = b - a;
    let length = ab.length_squared();
    let t = if length > 0.0 { ((p - a).dot(ab) / length).clamp(0.0, 1.0) } else { 0.0 };
    p.distance(a + t * ab)
}

/// Distance from a point to a triangle, which may have no area.
fn distance_to_triangle(p: Vec3, [a, b, c]: [Vec3; 3]) -> f32 {
    let normal = area_normal([a, b, c]);
    let inside = [[a, b], [b, c], [c, a]]
        .into_iter()
        .all(|[from, to]| (to - from).cross(p - from).dot(normal) >= 0.0);
    let length = normal.length();
    if inside && length > 0.0 {
        return ((p - a).dot(normal) / length).abs();
    }
    distance_to_segment(p, a, b).min(distance_to_segment(p, b, c)).min(distance_to_segment(p, c, a))
}

#[cfg(test)]
mod tests {
    use glam::vec3;
    use proptest::prelude::*;

    use super::*;

    fn point() -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(-1.0f32..1.0).prop_map(Vec3::from_array)
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        #[test]
        fn triangle_distance_matches_a_dense_sampling(p in point(), t in prop::array::uniform3(point())) {
            let n = 60;
            let mut nearest = f32::INFINITY;
            for i in 0..=n {
                for j in 0..=n - i {
                    let (s, t2) = (i as f32 / n as f32, j as f32 / n as f32);
                    nearest = nearest.min(p.distance(t[0] + s * (t[1] - t[0]) + t2 * (t[2] - t[0])));
                }
            }
            let distance = distance_to_triangle(p, t);
            prop_assert!(distance <= nearest + 1e-5);
            prop_assert!(distance >= nearest - 0.06, "{} {}", distance, nearest);
        }
    }

    #[test]
    fn a_triangle_without_area_is_its_longest_edge() {
        let p = vec3(0.5, 1.0, 0.0);
        let d = distance_to_triangle(p, [Vec3::ZERO, Vec3::X, Vec3::ZERO]);
        assert_eq!(d, 1.0);
    }
}
