//! Colours of vertices, and what collapses do to the colour of the surface.
//!
//! Colours are interpolated between vertices. So a vertex is missed as far as its colour is another one than what the triangles
//! that are left have where it was; and the more of the surface it stands for, the more. Where colours change evenly nothing is
//! lost; where an edge of two colours is, what keeps it is worth as much as the two are apart.
//!
//! # Sources
//! Hoppe, *New Quadric Metric for Simplifying Meshes with Appearance Attributes*, 1999, measures attributes against what is
//! interpolated, too, but along planes of the input; here it is the star that a collapse leaves.

use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec4};
use mesh_io::Colour;

use crate::portion::Window;

/// The colour of a vertex, and how much of the surface it stands for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Paint {
    pub(crate) colour: Colour,
    /// Area, of each triangle for each of its corners, as in the quadrics of positions; with that of all vertices it has taken.
    pub(crate) area: f32,
}

impl Paint {
    /// A vertex of this colour that stands for nothing yet.
    pub(crate) fn new(colour: Colour) -> Self {
        Self { colour, area: 0.0 }
    }

    /// Adds a part of the surface.
    #[inline]
    pub(crate) fn add_area(&mut self, area: f32) {
        if area.is_finite() {
            self.area += area;
        }
    }
}

/// The error of colours that a vertex leaves when it is collapsed into its neighbour `u`: the squared difference between its
/// colour and the one that the surface has then where the vertex was, times the area that it stands for. Components are 0
/// to 1, alpha is one of four.
pub(crate) fn error(window: &Window<'_>, v: u32, u: u32) -> f32 {
    let at = window.position(u);
    let from = window.position(v) - at;
    let mut nearest = (f32::INFINITY, Vec3::X, [u; 3]);
    for (a, b) in window.stars.fans(v).triangles() {
        if a != u && b != u {
            let [p, q] = [a, b].map(|x| window.position(x) - at);
            let (distance, weights) = nearest_point(from, p, q);
            if distance < nearest.0 {
                nearest = (distance, weights, [u, a, b]);
            }
        }
    }
    let (_, weights, corners) = nearest;
    let components = |x: u32| window.paint(x).colour.map(f32::from);
    let [c, p, q] = corners.map(|x| Vec4::from_array(components(x)));
    let paint = window.paint(v);
    let own = Vec4::from_array(paint.colour.map(f32::from));
    let difference = weights.x * c + weights.y * p + weights.z * q - own;
    paint.area * difference.length_squared() / (255.0 * 255.0)
}

/// The squared distance of `p` from the triangle of the origin, `a` and `b`, and the weights of these in the nearest point.
///
/// # Sources
/// Ericson, *Real-Time Collision Detection*, 2005, §5.1.5.
#[inline]
fn nearest_point(p: Vec3, a: Vec3, b: Vec3) -> (f32, Vec3) {
    let weights = nearest_weights(p, a, b);
    ((weights.y * a + weights.z * b).distance_squared(p), weights)
}

#[inline]
fn nearest_weights(p: Vec3, a: Vec3, b: Vec3) -> Vec3 {
    let (d1, d2) = (a.dot(p), b.dot(p));
    if d1 <= 0.0 && d2 <= 0.0 {
        return Vec3::X;
    }
    let (d3, d4) = (a.dot(p - a), b.dot(p - a));
    if d3 >= 0.0 && d4 <= d3 {
        return Vec3::Y;
    }
    let of_b = d1 * d4 - d3 * d2;
    if of_b <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let k = share(d1, d1 - d3);
        return Vec3::new(1.0 - k, k, 0.0);
    }
    let (d5, d6) = (a.dot(p - b), b.dot(p - b));
    if d6 >= 0.0 && d5 <= d6 {
        return Vec3::Z;
    }
    let of_a = d5 * d2 - d1 * d6;
    if of_a <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let k = share(d2, d2 - d6);
        return Vec3::new(1.0 - k, 0.0, k);
    }
    let of_origin = d3 * d6 - d5 * d4;
    let (e, f) = (d4 - d3, d5 - d6);
    if of_origin <= 0.0 && e >= 0.0 && f >= 0.0 {
        let k = share(e, e + f);
        return Vec3::new(0.0, 1.0 - k, k);
    }
    let sum = of_origin + of_a + of_b;
    let (k, l) = (share(of_a, sum), share(of_b, sum));
    Vec3::new(1.0 - k - l, k, l)
}

/// A quotient, and zero where there is none.
#[inline]
fn share(part: f32, of: f32) -> f32 {
    if of > 0.0 { part / of } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        #[test]
        fn no_point_of_the_triangle_is_nearer(
            coordinates in prop::array::uniform9(-1f32..1.0),
            samples in prop::collection::vec(prop::array::uniform2(0f32..1.0), 40),
        ) {
            let [p, a, b] = [0, 3, 6].map(|i| Vec3::from_slice(&coordinates[i..]));
            let (distance, weights) = nearest_point(p, a, b);
            prop_assert!((weights.element_sum() - 1.0).abs() < 1e-4 && weights.min_element() > -1e-3, "{weights}");
            for [k, l] in samples {
                let (k, l) = if k + l > 1.0 { (1.0 - k, 1.0 - l) } else { (k, l) };
                prop_assert!((k * a + l * b).distance_squared(p) > distance - 1e-3);
            }
        }
    }

    #[test]
    fn triangles_of_nothing_have_nearest_points() {
        for (a, b) in [(Vec3::ZERO, Vec3::ZERO), (Vec3::X, Vec3::X), (Vec3::X, Vec3::NEG_X)] {
            let (distance, weights) = nearest_point(Vec3::new(0.3, 0.4, 0.0), a, b);
            assert!(distance.is_finite() && weights.is_finite(), "{a} {b}");
        }
    }
}
