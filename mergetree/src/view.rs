//! The view test: how many pixels off the picture is while a node is not split.

use glam::Vec3;

use crate::{Camera, Node};

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
        }
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
    #[inline]
    pub fn error_px(&self, node: &Node) -> f32 {
        let to_node = node.position - self.eye;
        let outside = |normal: Vec3| normal.dot(to_node) < -node.radius;
        if self.sides.into_iter().any(outside) || outside(self.forward) {
            return 0.0;
        }
        let distance = to_node.length();
        let nearest = distance - node.radius;
        if nearest <= 0.0 {
            return if node.deviation > 0.0 { f32::INFINITY } else { 0.0 };
        }
        let pixels = node.deviation * self.pixels_per_radian / nearest;
        // Lines of sight to the sphere spread by β, normals by α around their axis.
        let (sin_a, sin_b) = (node.cone_sine, node.radius / distance);
        let cos_a = (1.0 - sin_a * sin_a).max(0.0).sqrt();
        let cos_b = (1.0 - sin_b * sin_b).max(0.0).sqrt();
        let cos_spread = cos_a * cos_b - sin_a * sin_b;
        if sin_a >= 1.0 || cos_spread <= 0.0 {
            return pixels;
        }
        let sin_spread = sin_a * cos_b + cos_a * sin_b;
        // Cosine of the angle between axis and line of sight; positive when facing away.
        let facing_away = self.outward * node.normal.to_vec3().dot(to_node) / distance;
        if facing_away > sin_spread {
            return 0.0;
        }
        if facing_away < -sin_spread {
            // All of it faces the eye: sine of the largest angle between a normal and its line of sight.
            let sin_facing = (1.0 - facing_away * facing_away).max(0.0).sqrt();
            let tilt = sin_facing * cos_spread - facing_away * sin_spread;
            return pixels * tilt.clamp(FACE_ON_SHARE, 1.0);
        }
        pixels
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
    use crate::OctNormal;

    fn node(position: Vec3, radius: f32, normal: Vec3, cone_sine: f32) -> Node {
        Node {
            position,
            radius,
            normal: OctNormal::new(normal),
            cone_sine,
            deviation: 0.01,
            order: 0,
            adjacent: [None; 4],
            left: None,
            right: None,
            parent: None,
            slot: None,
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
