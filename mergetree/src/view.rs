//! The view test: how many pixels off the picture is while a node is not split.

use glam::Vec3;
use wide::f32x8;

use crate::measure::LANES;
use crate::{BoundsLanes, Camera, ErrorMeasure, NodeBounds};

/// What of a node is compared with the size of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ViewTest {
    /// How far the surface moves, less where it is seen face on.
    #[default]
    Deviation,
    /// The extent of what the node changes (first paper, §4.3): many more triangles for the same picture. To compare with.
    Radius,
}

/// A camera prepared for testing nodes (FastMesh's criteria, Pajarola 2001: frustum, orientation, silhouettes, screen
/// space error; but with a measured deviation in place of the mere extent).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    eye: Vec3,
    /// Inward unit normals of the planes through the eye that bound the picture: left, right, bottom, top.
    sides: [Vec3; 4],
    forward: Vec3,
    pixels_per_radian: f32,
    /// 1 where normals point outwards, −1 where they point inwards.
    outward: f32,
    test: ViewTest,
}

/// Share of the deviation that counts where a surface is seen face on.
///
/// Moving a surface along the line of sight moves no pixel; what remains is shading, and parallax when the camera moves.
const FACE_ON_SHARE: f32 = 0.4;

impl View {
    /// The view of a camera.
    pub fn new(camera: &Camera) -> Self {
        let to_world = camera.view_matrix().inverse();
        let half_height = (0.5 * camera.fov_y).tan();
        let half_width = half_height * camera.aspect();
        // In camera space the planes hold the eye and an edge of the picture at distance one.
        let side = |v: Vec3| to_world.transform_vector3(v).normalize();
        Self {
            eye: camera.eye,
            sides: [
                side(Vec3::new(1.0, 0.0, -half_width)),
                side(Vec3::new(-1.0, 0.0, -half_width)),
                side(Vec3::new(0.0, 1.0, -half_height)),
                side(Vec3::new(0.0, -1.0, -half_height)),
            ],
            forward: side(Vec3::NEG_Z),
            pixels_per_radian: camera.pixels_per_radian(),
            outward: 1.0,
            test: ViewTest::Deviation,
        }
    }

    /// The same view with another test.
    #[must_use]
    pub fn with_test(self, test: ViewTest) -> Self {
        Self { test, ..self }
    }

    /// The same view of a surface that may be inside out ([`crate::BaseMesh::is_inside_out`]): then its normals point
    /// inwards.
    #[must_use]
    pub fn inside_out(self, is_inside_out: bool) -> Self {
        Self { outward: if is_inside_out { -1.0 } else { 1.0 }, ..self }
    }

    /// The screen-space error of a node that is not split, in pixels: zero outside the picture and where all below it
    /// faces away; its deviation as seen from the nearest point of its sphere, larger towards the silhouette; infinite
    /// when the eye is inside the sphere.
    ///
    /// A child's error never exceeds its parent's, but for rounding.
    pub fn error_px(&self, bounds: &NodeBounds) -> f32 {
        self.errors(&BoundsLanes::splat(bounds))[0]
    }
}

/// A vector in every lane.
#[derive(Clone, Copy)]
struct Vec3x8([f32x8; 3]);

impl Vec3x8 {
    #[inline(always)]
    fn dot(self, v: Vec3) -> f32x8 {
        let [x, y, z] = self.0;
        x * f32x8::splat(v.x) + y * f32x8::splat(v.y) + z * f32x8::splat(v.z)
    }

    #[inline(always)]
    fn dot_lanes(self, other: Self) -> f32x8 {
        let ([x, y, z], [u, v, w]) = (self.0, other.0);
        x * u + y * v + z * w
    }
}

impl ErrorMeasure for View {
    #[inline]
    fn errors(&self, bounds: &BoundsLanes) -> [f32; LANES] {
        let (zero, one) = (f32x8::ZERO, f32x8::ONE);
        let [x, y, z] = bounds.position.map(f32x8::new);
        let [eye_x, eye_y, eye_z] = self.eye.to_array().map(f32x8::splat);
        let to_node = Vec3x8([x - eye_x, y - eye_y, z - eye_z]);
        let radius = f32x8::new(bounds.radius);
        let outside = |normal: Vec3| to_node.dot(normal).simd_lt(-radius);
        let [left, right, bottom, top] = self.sides.map(outside);
        let hidden = left | right | bottom | top | outside(self.forward);
        if hidden.all() {
            return [0.0; LANES];
        }
        let distance = to_node.dot_lanes(to_node).sqrt();
        let nearest = distance - radius;
        let deviation = f32x8::new(bounds.deviation);
        let size = match self.test {
            ViewTest::Deviation => deviation,
            ViewTest::Radius => radius,
        };
        let pixels = size * f32x8::splat(self.pixels_per_radian) / nearest;
        // Lines of sight to the sphere spread by β, normals by α around their axis.
        let (sin_a, sin_b) = (f32x8::new(bounds.cone_sine), radius / distance);
        let cosine = |sine: f32x8| (one - sine * sine).fast_max(zero).sqrt();
        let (cos_a, cos_b) = (cosine(sin_a), cosine(sin_b));
        let cos_spread = cos_a * cos_b - sin_a * sin_b;
        let sin_spread = sin_a * cos_b + cos_a * sin_b;
        let spread_is_wide = sin_a.simd_ge(one) | cos_spread.simd_le(zero);
        // Cosine of the angle between axis and line of sight; positive when facing away.
        let normal = Vec3x8(bounds.normal.map(f32x8::new));
        let facing_away = f32x8::splat(self.outward) * normal.dot_lanes(to_node) / distance;
        let away = facing_away.simd_gt(sin_spread);
        // All of it faces the eye: sine of the largest angle between a normal and its line of sight.
        let faces = facing_away.simd_lt(-sin_spread);
        let tilt = cosine(facing_away) * cos_spread - facing_away * sin_spread;
        let tilt = tilt.fast_max(f32x8::splat(FACE_ON_SHARE)).fast_min(one);
        let tilt = match self.test {
            ViewTest::Deviation => faces.select(tilt, one),
            ViewTest::Radius => one,
        };
        let turned = away.select(zero, pixels * tilt);
        let seen = spread_is_wide.select(pixels, turned);
        let inside = size.simd_gt(zero).select(f32x8::splat(f32::INFINITY), zero);
        let error = nearest.simd_le(zero).select(inside, seen);
        hidden.select(zero, error).to_array()
    }
}

/// Chooses the tolerance so that a number of triangles, or any other measured load, is held.
///
/// The tolerance rises at once when the load is above its budget and falls slowly when it is below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToleranceControl {
    tolerance: f32,
    min: f32,
    max: f32,
}

impl ToleranceControl {
    /// Begins at `tolerance` and stays within `min..=max`.
    pub fn new(tolerance: f32, min: f32, max: f32) -> Self {
        Self { tolerance: tolerance.clamp(min, max), min, max }
    }

    /// The tolerance for the next frame.
    pub fn tolerance(&self) -> f32 {
        self.tolerance
    }

    /// Takes in how the last frame's load compared to its budget, 1 being all of it.
    pub fn observe(&mut self, share_of_budget: f32) {
        let step = match share_of_budget {
            // Aimed a little below the budget, so that it is reached and not merely approached.
            over if over > 1.0 => (over / 0.95).sqrt().min(1.5),
            under if under < 0.9 => under.max(0.01).powf(0.25).max(0.8),
            _ => 1.0,
        };
        self.tolerance = (self.tolerance * step).clamp(self.min, self.max);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn node(position: Vec3, radius: f32, normal: Vec3, cone_sine: f32) -> NodeBounds {
        NodeBounds {
            position,
            radius,
            normal: normal.normalize(),
            cone_sine,
            deviation: 0.01,
            order: 0,
        }
    }

    fn view() -> View {
        View::new(&Camera { eye: Vec3::new(0.0, 0.0, 10.0), ..Camera::default() })
    }

    #[test]
    fn what_is_outside_or_behind_has_no_error() {
        let view = view();
        assert!(view.error_px(&node(Vec3::ZERO, 0.1, Vec3::Z, 0.1)) > 0.0);
        for away in [Vec3::X * 20.0, Vec3::NEG_X * 20.0, Vec3::Y * 20.0, Vec3::NEG_Y * 20.0] {
            assert_eq!(view.error_px(&node(away, 0.1, Vec3::Z, 0.1)), 0.0);
        }
        assert_eq!(view.error_px(&node(Vec3::Z * 12.0, 0.1, Vec3::Z, 0.1)), 0.0);
    }

    #[test]
    fn what_faces_away_has_no_error_and_silhouettes_have_most() {
        let view = view();
        let error = |normal| view.error_px(&node(Vec3::ZERO, 0.1, normal, 0.1));
        assert_eq!(error(Vec3::NEG_Z), 0.0);
        assert!(error(Vec3::X) > 2.0 * error(Vec3::Z));
        assert!(error(Vec3::new(1.0, 0.0, 1.0)) < error(Vec3::X));
        let turned = |normal| view.inside_out(true).error_px(&node(Vec3::ZERO, 0.1, normal, 0.1));
        assert_eq!(turned(Vec3::Z), 0.0);
        assert_eq!(turned(Vec3::NEG_Z), error(Vec3::Z));
    }

    #[test]
    fn nearer_is_worse_and_inside_is_worst() {
        let view = view();
        let error = |z| view.error_px(&node(Vec3::Z * z, 0.1, Vec3::Z, 1.0));
        assert!(error(5.0) > error(0.0));
        assert_eq!(error(9.95), f32::INFINITY);
        // A hundredth at distance 9.9 to the sphere, 720 pixels over 45 degrees.
        let expected = 0.01 / 9.9 * 360.0 / 22.5f32.to_radians().tan();
        assert!((error(0.0) - expected).abs() < 1e-3 * expected);
    }

    #[test]
    fn the_tolerance_settles_where_the_budget_is_used_up() {
        let mut control = ToleranceControl::new(1.0, 0.01, 100.0);
        for _ in 0..200 {
            // Triangles go with one over the tolerance.
            control.observe(3.0 / control.tolerance());
        }
        let share = 3.0 / control.tolerance();
        assert!((0.9..=1.0).contains(&share), "{share}");
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        #[test]
        fn a_child_is_never_worse_than_its_parent(
            at in prop::array::uniform3(-3.0f32..3.0),
            offset in prop::array::uniform3(-0.3f32..0.3),
            normal in prop::array::uniform3(-1.0f32..1.0),
            turn in prop::array::uniform3(-0.3f32..0.3),
            radius in 0.0f32..0.5,
            cone in 0.0f32..1.0,
        ) {
            let (at, offset) = (Vec3::from_array(at), Vec3::from_array(offset));
            let normal = Vec3::from_array(normal).normalize_or(Vec3::Z);
            let other = (normal + Vec3::from_array(turn)).normalize_or(normal);
            let child = node(at + offset, radius, other, cone);
            let angle = normal.angle_between(other) + cone.asin() + 1e-3;
            let sine = if angle < 1.57 { angle.sin() } else { 1.0 };
            let parent = node(at, (radius + offset.length()) * 1.0001, normal, sine);
            let view = view();
            prop_assert!(view.error_px(&child) <= view.error_px(&parent) * 1.001);
        }
    }
}
