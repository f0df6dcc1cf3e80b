//! How far a collapse moves the surface from the input, both ways: an estimate, and an upper bound.
//!
//! For the bound, every vertex has a bound; between the vertices of a triangle the bound is linear. It says of each point of the surface
//! how far the point of the input that was mapped there lies away at most. A collapse replaces a patch of triangles, and
//! maps the old patch to the new one by projecting both onto a plane. On each cell of the overlay of both triangulations
//! the old bound is linear and the distance between both surfaces convex, so a bound for the new vertex is right
//! everywhere if it is right at the corners of the cells: at the vertices that go, at the new one, and where an old edge
//! crosses a new one.
//!
//! # Sources
//! Cohen, Manocha and Olano, *Simplifying Polygonal Models Using Successive Mappings*, 1997, §4.

use glam::{Vec2, Vec3};

use crate::distance::distance_to_triangle;

/// Cosine of the angle between a triangle and the plane of projection below which the projection is not used.
const LEAST_COSINE: f32 = 1e-3;

/// The triangles around two vertices that are to become one.
#[derive(Clone, Debug, Default)]
pub(crate) struct Patch {
    /// The two vertices, then those around them.
    points: Vec<Vec3>,
    bounds: Vec<f32>,
    triangles: Vec<[usize; 3]>,
    /// For the bound: the edges at either of the two vertices, and whether they are boundary.
    edges: Vec<([usize; 2], bool)>,
    /// For the bound: the points in the plane of projection.
    flat: Vec<Vec2>,
}

impl Patch {
    /// Starts with two vertices and their bounds, and without triangles.
    pub(crate) fn restart(&mut self, ends: [(Vec3, f32); 2]) {
        self.points.clear();
        self.bounds.clear();
        self.triangles.clear();
        for (point, bound) in ends {
            self.add_vertex(point, bound);
        }
    }

    /// Adds a vertex around both, and returns its number; the two vertices themselves have the numbers 0 and 1.
    pub(crate) fn add_vertex(&mut self, point: Vec3, bound: f32) -> usize {
        self.points.push(point);
        self.bounds.push(bound);
        self.points.len() - 1
    }

    /// Adds a triangle, which has to have one of the two vertices or both.
    pub(crate) fn add_triangle(&mut self, corners: [usize; 3]) {
        self.triangles.push(corners);
    }

    /// The triangles after both vertices have become one: their two corners beside that.
    fn triangles_after(&self) -> impl Iterator<Item = [usize; 2]> + '_ {
        self.triangles.iter().filter_map(|&[a, b, c]| match [a, b, c].map(|v| v < 2) {
            [true, false, false] => Some([b, c]),
            [false, true, false] => Some([c, a]),
            [false, false, true] => Some([a, b]),
            _ => None,
        })
    }

    /// How far the surface lies from the input if both vertices become one at `at`: as far as it lay before, and as far as
    /// both vertices lie from the triangles after; or as the edges after from the triangles before, where two
    /// triangulations of a ring are farthest apart. What is not more than `enough` may count as nothing.
    pub(crate) fn estimate_after(&self, at: Vec3, enough: f32) -> f32 {
        let forth = (0..2).map(|v| {
            let after = self.triangles_after().map(|[r, s]| [at, self.points[r], self.points[s]]);
            self.bounds[v] + nearest(self.points[v], after, 0.0)
        });
        let back = (2..self.points.len()).map(|r| {
            // Most often it is nearest to one at its own end.
            let (own, other) =
                (|t: &&[usize; 3]| t.contains(&r), |t: &&[usize; 3]| !t.contains(&r));
            let triangles =
                self.triangles.iter().filter(own).chain(self.triangles.iter().filter(other));
            let corners = triangles.map(|t| t.map(|v| self.points[v]));
            nearest(at.midpoint(self.points[r]), corners, enough)
        });
        forth.chain(back).fold(0.0, f32::max)
    }

    /// The bound of the one vertex that both become, if it is placed at `at`.
    pub(crate) fn bound_after(&mut self, at: Vec3) -> f32 {
        self.find_edges();
        // Every triangle moves along with its vertex: always right, but sliding within the surface counts in full.
        let moved =
            (0..2).map(|v| self.bounds[v] + self.points[v].distance(at)).fold(0.0, f32::max);
        match self.project(at) {
            Some(flat_at) => moved.min(self.bound_by_overlay(at, flat_at)),
            None => moved,
        }
    }

    fn find_edges(&mut self) {
        self.edges.clear();
        for &[a, b, c] in &self.triangles {
            for [i, j] in [[a, b], [b, c], [c, a]] {
                let ends = [i.min(j), i.max(j)];
                match self.edges.iter_mut().find(|edge| edge.0 == ends) {
                    Some(edge) => edge.1 = false,
                    None if ends[0] < 2 => self.edges.push((ends, true)),
                    None => {}
                }
            }
        }
    }

    /// Projects all points to a plane in which no triangle lies upside down, before or after; and where `at` is there.
    fn project(&mut self, at: Vec3) -> Option<Vec2> {
        let origin = self.points[0];
        let normal_of = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a);
        let before = |t: &[usize; 3]| normal_of(t.map(|v| self.points[v] - origin));
        let after = |[r, s]: [usize; 2]| {
            normal_of([at, self.points[r], self.points[s]].map(|p| p - origin))
        };
        let sum = self
            .triangles
            .iter()
            .map(before)
            .chain(self.triangles_after().map(after))
            .sum::<Vec3>();
        let axis = sum.try_normalize()?;
        let upright = |normal: Vec3| {
            let cosine = normal.dot(axis);
            cosine > 0.0 && cosine * cosine > LEAST_COSINE * LEAST_COSINE * normal.length_squared()
        };
        let upright_before = |t| {
            let normal = before(t);
            // A triangle without area maps to a line, whatever its direction.
            normal == Vec3::ZERO || upright(normal)
        };
        if !self.triangles.iter().all(upright_before)
            || !self.triangles_after().map(after).all(upright)
        {
            return None;
        }
        let (x, y) = axis.any_orthonormal_pair();
        let flat = |p: Vec3| Vec2::new(x.dot(p - origin), y.dot(p - origin));
        self.flat.clear();
        self.flat.extend(self.points.iter().map(|&p| flat(p)));
        Some(flat(at))
    }

    fn bound_by_overlay(&self, at: Vec3, flat_at: Vec2) -> f32 {
        let mut bound = match self.boundary().next() {
            Some(_) => self.needed_by_boundary(at),
            None => self.needed_by_new(at, flat_at),
        };
        for v in (0..2).filter(|v| !self.boundary().any(|edge| edge.contains(v))) {
            bound = bound.max(self.needed_by_old(v, at, flat_at));
        }
        for &([i, j], _) in &self.edges {
            for r in (2..self.points.len()).filter(|&r| r != j) {
                let old = [self.flat[i], self.flat[j]];
                if let Some([s, t]) = crossing(old, [self.flat[r], flat_at]) {
                    let point = self.points[i].lerp(self.points[j], s);
                    let before = lerp(self.bounds[i], self.bounds[j], s);
                    bound = bound.max(self.needed_on_edge(point, before, r, at, t));
                }
            }
        }
        bound
    }

    /// The boundary edges at either of the two vertices.
    fn boundary(&self) -> impl Iterator<Item = [usize; 2]> + '_ {
        self.edges.iter().filter(|edge| edge.1).map(|edge| edge.0)
    }

    /// What the point of the old patch that is mapped to the new vertex asks for.
    fn needed_by_new(&self, at: Vec3, flat_at: Vec2) -> f32 {
        let beneath = |t: &[usize; 3]| Some((*t, shares(t.map(|v| self.flat[v]), flat_at)?));
        let Some((corners, shares)) = innermost(self.triangles.iter().filter_map(beneath)) else {
            return f32::INFINITY;
        };
        let parts = || corners.iter().zip(shares);
        let point: Vec3 = parts().map(|(&v, share)| share * self.points[v]).sum();
        parts().map(|(&v, share)| share * self.bounds[v]).sum::<f32>() + point.distance(at)
    }

    /// What the vertex `v`, which goes, asks for where it is mapped to in the new patch.
    fn needed_by_old(&self, v: usize, at: Vec3, flat_at: Vec2) -> f32 {
        let above = |[r, s]: [usize; 2]| {
            let shares = shares([flat_at, self.flat[r], self.flat[s]], self.flat[v])?;
            Some(([r, s], shares))
        };
        let Some(([r, s], [a, b, c])) = innermost(self.triangles_after().filter_map(above)) else {
            return f32::INFINITY;
        };
        let mapped = a * at + b * self.points[r] + c * self.points[s];
        let others = b * self.bounds[r] + c * self.bounds[s];
        needed(self.bounds[v] + self.points[v].distance(mapped), others, a)
    }

    /// What the boundary asks for, of which the old part is mapped to the new one in order: the new vertex to one of its
    /// edges, the old vertices before and after that to the new edges before and after it.
    fn needed_by_boundary(&self, at: Vec3) -> f32 {
        let outer: Vec<_> = self.boundary().filter(|edge| edge[1] >= 2).collect();
        let &[[a, first], [b, last]] = outer.as_slice() else { return f32::INFINITY };
        let chain = [first, a, b, last];
        let chain = if a == b { &[first, a, last][..] } else { &chain[..] };
        let along_edge = |edge: usize| {
            let (from, to) = (chain[edge], chain[edge + 1]);
            let t = nearest_on_segment(at, [self.points[from], self.points[to]]);
            let point = self.points[from].lerp(self.points[to], t);
            let of_new = lerp(self.bounds[from], self.bounds[to], t) + point.distance(at);
            let of_old = chain[1..chain.len() - 1].iter().enumerate().map(|(before, &v)| {
                let r = if before < edge { first } else { last };
                let t = nearest_on_segment(self.points[v], [self.points[r], at]);
                self.needed_on_edge(self.points[v], self.bounds[v], r, at, t)
            });
            of_old.fold(of_new, f32::max)
        };
        (0..chain.len() - 1).map(along_edge).fold(f32::INFINITY, f32::min)
    }

    /// What a point of the old patch asks for that is mapped to the edge from `r` to the new vertex, to the share `t` of it.
    fn needed_on_edge(&self, point: Vec3, before: f32, r: usize, at: Vec3, t: f32) -> f32 {
        let mapped = self.points[r].lerp(at, t);
        needed(before + point.distance(mapped), (1.0 - t) * self.bounds[r], t)
    }
}

/// The distance of a point from the nearest of some triangles, or from one that is not farther than `enough`.
fn nearest(p: Vec3, triangles: impl Iterator<Item = [Vec3; 3]>, enough: f32) -> f32 {
    let mut least = f32::INFINITY;
    for triangle in triangles {
        least = least.min(distance_to_triangle(p, triangle));
        if least <= enough {
            break;
        }
    }
    least
}

/// The bound that a vertex has to have, so that with its `share` and that of the `others` there is enough for `total`.
fn needed(total: f32, others: f32, share: f32) -> f32 {
    if total > others { (total - others) / share.max(0.0) } else { 0.0 }
}

fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + t * (b - a)
}

/// Where along a segment the point nearest to `p` lies, from 0 to 1.
fn nearest_on_segment(p: Vec3, [a, b]: [Vec3; 2]) -> f32 {
    let ab = b - a;
    let length = ab.length_squared();
    if length > 0.0 { ((p - a).dot(ab) / length).clamp(0.0, 1.0) } else { 0.0 }
}

/// Where two segments cross, from 0 to 1 along each; `None` if they do not, or do where the second one begins, or lie along
/// each other.
fn crossing([a, b]: [Vec2; 2], [c, d]: [Vec2; 2]) -> Option<[f32; 2]> {
    /// Nearer to where nothing moves there is only rounding.
    const BEGINNING: f32 = 1e-4;
    let (one, other) = (b - a, d - c);
    let area = one.perp_dot(other);
    let s = (c - a).perp_dot(other) / area;
    let t = (c - a).perp_dot(one) / area;
    ((0.0..=1.0).contains(&s) && (BEGINNING..=1.0).contains(&t)).then_some([s, t])
}

/// The barycentric coordinates of a point; `None` for a triangle without area.
fn shares([a, b, c]: [Vec2; 3], p: Vec2) -> Option<[f32; 3]> {
    let area = (b - a).perp_dot(c - a);
    let [of_b, of_c] = [(p - a).perp_dot(c - a) / area, (b - a).perp_dot(p - a) / area];
    (area != 0.0).then_some([1.0 - of_b - of_c, of_b, of_c])
}

/// The triangle that a point lies deepest in, if it lies in any, with its barycentric coordinates.
fn innermost<T>(triangles: impl Iterator<Item = (T, [f32; 3])>) -> Option<(T, [f32; 3])> {
    /// Points on an edge are in both triangles, or by rounding in none.
    const OUTSIDE: f32 = -1e-4;
    let depth = |shares: &[f32; 3]| shares.iter().copied().fold(f32::INFINITY, f32::min);
    triangles
        .filter(|(_, shares)| depth(shares) >= OUTSIDE)
        .max_by(|(_, a), (_, b)| depth(a).total_cmp(&depth(b)))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Two vertices near the middle of a wheel, the first `left` parts of whose rim belong to the first one.
    fn wheel(ends: [Vec3; 2], rim: &[Vec3], left: usize) -> Patch {
        let mut patch = Patch::default();
        patch.restart(ends.map(|p| (p, 0.0)));
        let rim: Vec<usize> = rim.iter().map(|&p| patch.add_vertex(p, 0.0)).collect();
        let parts = rim.iter().copied().zip(rim.iter().copied().cycle().skip(1));
        parts.clone().take(left).for_each(|(r, s)| patch.add_triangle([0, r, s]));
        patch.add_triangle([0, rim[left], 1]);
        parts.skip(left).for_each(|(r, s)| patch.add_triangle([1, r, s]));
        patch.add_triangle([1, rim[0], 0]);
        patch
    }

    fn rim(heights: &[f32]) -> Vec<Vec3> {
        let step = std::f32::consts::TAU / heights.len() as f32;
        let at =
            |(i, &z): (usize, &f32)| Vec3::new((step * i as f32).cos(), (step * i as f32).sin(), z);
        heights.iter().enumerate().map(at).collect()
    }

    /// The greatest distance from points spread over some triangles to others.
    fn farthest(from: &[[Vec3; 3]], to: &[[Vec3; 3]]) -> f32 {
        let n = 24;
        let mut most = 0.0f32;
        for &[a, b, c] in from {
            for (i, j) in (0..=n).flat_map(|i| (0..=n - i).map(move |j| (i, j))) {
                let p = a + (b - a) * (i as f32 / n as f32) + (c - a) * (j as f32 / n as f32);
                let nearest = to.iter().map(|&t| distance_to_triangle(p, t));
                most = most.max(nearest.fold(f32::INFINITY, f32::min));
            }
        }
        most
    }

    fn before(patch: &Patch) -> Vec<[Vec3; 3]> {
        patch.triangles.iter().map(|t| t.map(|v| patch.points[v])).collect()
    }

    fn after(patch: &Patch, at: Vec3) -> Vec<[Vec3; 3]> {
        patch.triangles_after().map(|[r, s]| [at, patch.points[r], patch.points[s]]).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        #[test]
        fn no_point_moves_farther_than_the_bound(
            heights in prop::collection::vec(-1.0f32..1.0, 4..9),
            ends in prop::array::uniform2((-0.3f32..0.3, 0.0f32..0.3, -0.4f32..0.4)),
            at in prop::array::uniform3(-0.5f32..0.5),
            open in any::<bool>(),
        ) {
            let [(a, b, c), (d, e, f)] = ends;
            let at = Vec3::from_array(at);
            let mut patch = wheel([Vec3::new(a, b, c), Vec3::new(d, -e, f)], &rim(&heights), 2);
            if open {
                // A sector beside the edge between both goes: now both are on the boundary.
                let mut triangles = std::mem::take(&mut patch.triangles);
                triangles.truncate(triangles.len() - 2);
                triangles.into_iter().for_each(|t| patch.add_triangle(t));
            }
            let bound = patch.bound_after(at);
            let (before, after) = (before(&patch), after(&patch, at));
            let moved = farthest(&before, &after).max(farthest(&after, &before));
            prop_assert!(moved <= bound + 1e-4, "{} > {}", moved, bound);
        }
    }

    #[test]
    fn sliding_within_a_plane_is_free() {
        let ends = [Vec3::new(0.1, 0.3, 0.0), Vec3::new(-0.1, -0.3, 0.0)];
        let mut patch = wheel(ends, &rim(&[0.0; 7]), 3);
        assert!(patch.bound_after(Vec3::new(0.1, 0.3, 0.0)) < 1e-6);
        assert!((patch.bound_after(Vec3::new(0.1, 0.3, 0.25)) - 0.25).abs() < 1e-4);
    }

    #[test]
    fn earlier_bounds_are_carried_on() {
        let ends = [Vec3::new(0.0, 0.3, 0.0), Vec3::new(0.0, -0.3, 0.0)];
        let mut patch = wheel(ends, &rim(&[0.0; 6]), 3);
        patch.bounds[0] = 0.5;
        // Halfway between a vertex with the bound and one without, of which the other one has to take all.
        assert!(patch.bound_after(Vec3::ZERO) >= 0.5);
        patch.bounds.fill(0.5);
        assert!((patch.bound_after(Vec3::ZERO) - 0.5).abs() < 1e-5);
    }

    #[test]
    fn a_straight_boundary_may_lose_vertices_but_no_corner() {
        // A strip below the x axis; both ends on the axis, which is boundary.
        let mut patch = Patch::default();
        patch.restart([(Vec3::new(1.0, 0.0, 0.0), 0.0), (Vec3::new(2.0, 0.0, 0.0), 0.0)]);
        let corners = [(0.0, 0.0), (0.0, -1.0), (3.0, -1.0), (3.0, 0.0)];
        let [a, b, c, d] = corners.map(|(x, y)| patch.add_vertex(Vec3::new(x, y, 0.0), 0.0));
        for t in [[0, a, b], [0, b, 1], [1, b, c], [1, c, d]] {
            patch.add_triangle(t);
        }
        assert!(patch.bound_after(Vec3::new(1.5, 0.0, 0.0)) < 1e-6);
        assert!((patch.bound_after(Vec3::new(1.5, -0.2, 0.0)) - 0.2).abs() < 0.1);
        assert!(patch.bound_after(Vec3::new(1.5, 0.2, 0.0)) >= 0.2);
    }
}
