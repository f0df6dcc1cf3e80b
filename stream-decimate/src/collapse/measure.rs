//! What a collapse does to the triangles around it.

use glam::Vec3;
use halfedge::{HalfEdgeId, VertexId};

use crate::collapse::Collapsed;
use crate::new_star::{Middles, NewStar};
use crate::portion::{Window, state};
use crate::rate::boundary_moved;

/// Least cosine of the angle by which one collapse may turn a triangle.
const LEAST_COSINE: f32 = 0.2;

/// Squared lengths beyond this are near what single precision can hold: sums of a few of them may not be numbers.
const FARTHEST_SQUARED: f32 = 1e36;

/// How far the surface is from where it was, both ways, once `v` is at its neighbour `u`; `None` if a triangle is turned over,
/// against how it lay or against the surface, whose normals its corners carry, or if it is too large to tell.
pub(crate) fn moved(window: &Window<'_>, v: u32, u: u32) -> Option<f32> {
    let at = window.position(u);
    let from = window.position(v) - at;
    let mut star = NewStar::<1>::new([from, Vec3::ZERO], LEAST_COSINE);
    let mut middles = Middles::new();
    let fans = window.stars.fans(v);
    let normal = |x: u32| window.identity(x).mean;
    let (of_v, of_u) = (normal(v), normal(u));
    let mut farthest = from.length_squared();
    for (a, b) in fans.triangles() {
        let [p, q] = [a, b].map(|x| window.position(x) - at);
        farthest = farthest.max(p.length_squared()).max(q.length_squared());
        if a == u || b == u {
            continue;
        }
        let (before, after) = ((p - from).cross(q - from), p.cross(q));
        let turned = |(then, now): (Vec3, Vec3)| after.dot(now) <= 0.0 && before.dot(then) > 0.0;
        let beside = [normal(a), normal(b)].map(|n| (n, n));
        if beside.into_iter().chain([(of_v, of_u)]).any(turned) {
            return None;
        }
        star.push(p, q, 0);
        middles.push(0.5 * p);
        if fans.position(b).is_some_and(|i| fans.is_last(i)) {
            middles.push(0.5 * q);
        }
    }
    let moved = star.finish_or(0.0);
    if moved == f32::INFINITY || farthest > FARTHEST_SQUARED {
        return None;
    }
    for (a, b) in fans.triangles() {
        let [p, q] = [a, b].map(|x| window.position(x) - at - from);
        middles.look(from, p, q);
    }
    let moved = moved.max(middles.farthest()).max(boundary_moved(window, v, u, at));
    moved.is_finite().then_some(moved)
}

/// What is to be told of the collapse of `v` into its neighbour `u`, which comes after it counter-clockwise if `v` is on a
/// boundary.
pub(crate) fn record(window: &Window<'_>, v: u32, u: u32, deviation: f32) -> Collapsed {
    let identity = |x: u32| window.identity(x);
    let normal = identity(v).normal.normalize_or_zero();
    let position = window.position(v);
    let (mut radius, mut cosine) = (0.0f32, 1.0f32);
    let mut widen = |[p, q, r]: [Vec3; 3]| {
        let cross = (q - p).cross(r - p);
        let length = cross.length();
        if length > 0.0 {
            cosine = cosine.min(cross.dot(normal) / length);
        }
    };
    let at = window.position(u);
    for (a, b) in window.stars.fans(v).triangles() {
        let [p, q] = [a, b].map(|x| window.position(x));
        radius = radius.max(p.distance_squared(position)).max(q.distance_squared(position));
        widen([position, p, q]);
        if a != u && b != u {
            widen([at, p, q]);
        }
    }
    let (half_edge, reverse, adjacent) = half_edges(window, v, u);
    Collapsed {
        removed: VertexId::new(identity(v).name),
        kept: VertexId::new(identity(u).name),
        half_edge,
        reverse,
        adjacent,
        position,
        normal,
        colour: window.colour(v),
        radius: radius.sqrt(),
        cone_cosine: cosine,
        deviation,
        rank: identity(v).touched.max(identity(u).touched),
    }
}

/// `h`, `h'` and `w, x, y, z`.
fn half_edges(
    window: &Window<'_>,
    v: u32,
    u: u32,
) -> (HalfEdgeId, Option<HalfEdgeId>, [Option<HalfEdgeId>; 4]) {
    let stars = &window.stars;
    let (of_v, of_u) = (stars.fans(v), stars.fans(u));
    let (n, m) = (of_v.len(), of_u.len());
    let at = |x: u32| of_u.position(x).unwrap_or(0);
    let prev = |h: u32| h / 3 * 3 + (h + 2) % 3;
    // The entry before another one, where a triangle is between both.
    let before = |i: usize| match i {
        0 => of_u.is_ring().then_some(m - 1),
        i => (!of_u.is_last(i - 1)).then_some(i - 1),
    };
    let to_u = of_v.position(u).unwrap_or(0);
    let after_u = (to_u + 1) % n;
    let h = stars.tag(v, to_u);
    let w = before(at(of_v.at(after_u))).map(|i| prev(stars.tag(u, i)));
    let x = (!of_v.is_last(after_u)).then(|| stars.tag(v, after_u));
    let (mut reverse, mut y, mut z) = (None, None, None);
    if window.state(v) == state::RING {
        let to_v = at(v);
        reverse = Some(stars.tag(u, to_v));
        y = Some(prev(stars.tag(v, (to_u + n - 2) % n)));
        let beyond = at(of_v.at((to_u + n - 1) % n));
        z = (!of_u.is_last(beyond)).then(|| stars.tag(u, beyond));
    }
    (HalfEdgeId::new(h), reverse.map(HalfEdgeId::new), [w, x, y, z].map(|h| h.map(HalfEdgeId::new)))
}
