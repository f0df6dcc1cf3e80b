//! A camera that turns around a point.

use glam::{Quat, Vec2, Vec3};
use mergetree::Camera;

/// Where the camera is, as an orbit: a point, a direction and a distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Orbit {
    center: Vec3,
    distance: f32,
    /// To the right, in radians.
    yaw: f32,
    /// Upwards, in radians; never as far as the poles.
    pitch: f32,
    radius: f32,
}

impl Orbit {
    /// The whole model from its front, a little above.
    pub(crate) fn around(min: Vec3, max: Vec3, lens: &Camera) -> Self {
        let framed = lens.framing(min, max, Vec3::NEG_Z);
        Self {
            center: framed.at,
            distance: framed.eye.distance(framed.at),
            yaw: 0.6,
            pitch: 0.3,
            radius: 0.5 * (max - min).length(),
        }
    }

    /// The camera there.
    pub(crate) fn camera(&self, lens: &Camera) -> Camera {
        let eye = self.center + self.distance * self.direction();
        Camera { eye, at: self.center, up: Vec3::Y, ..*lens }
    }

    /// From the centre to the eye.
    fn direction(&self) -> Vec3 {
        Quat::from_rotation_y(self.yaw) * (Quat::from_rotation_x(-self.pitch) * Vec3::Z)
    }

    /// Turns by a drag, as a share of the window's height.
    pub(crate) fn turn(&mut self, drag: Vec2) {
        self.yaw -= 4.0 * drag.x;
        self.pitch = (self.pitch + 4.0 * drag.y).clamp(-1.55, 1.55);
    }

    /// Moves the centre with a drag, as a share of the window's height, so that what is there follows the pointer.
    pub(crate) fn pan(&mut self, drag: Vec2, lens: &Camera) {
        let view = self.camera(lens).view_matrix();
        let height = 2.0 * self.distance * (0.5 * lens.fov_y).tan();
        let (right, up) = (view.row(0).truncate(), view.row(1).truncate());
        self.center += height * (up * drag.y - right * drag.x);
    }

    /// Goes nearer by so many notches of a wheel, or away where negative.
    pub(crate) fn zoom(&mut self, notches: f32) {
        let nearest = 1e-3 * self.radius;
        self.distance = (self.distance * 0.88f32.powf(notches)).clamp(nearest, 50.0 * self.radius);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drag_to_the_right_turns_the_model_to_the_right() {
        let lens = Camera::default();
        let mut orbit = Orbit::around(Vec3::NEG_ONE, Vec3::ONE, &lens);
        let front = orbit.camera(&lens).eye.normalize() * 0.5;
        orbit.turn(Vec2::new(0.05, 0.0));
        let seen = orbit.camera(&lens).view_matrix().transform_point3(front);
        assert!(seen.x > 0.0);
    }

    #[test]
    fn a_pan_moves_what_is_in_the_middle_with_the_pointer() {
        let lens = Camera::default();
        let mut orbit = Orbit::around(Vec3::NEG_ONE, Vec3::ONE, &lens);
        orbit.pan(Vec2::new(0.1, 0.0), &lens);
        let seen = orbit.camera(&lens).view_matrix().transform_point3(Vec3::ZERO);
        assert!(seen.x > 0.0 && seen.y.abs() < 1e-4);
    }

    #[test]
    fn zooming_in_and_out_again_comes_back() {
        let lens = Camera::default();
        let mut orbit = Orbit::around(Vec3::NEG_ONE, Vec3::ONE, &lens);
        let before = orbit;
        orbit.zoom(3.0);
        assert!(orbit.camera(&lens).eye.length() < before.camera(&lens).eye.length());
        orbit.zoom(-3.0);
        assert!(orbit.camera(&lens).eye.distance(before.camera(&lens).eye) < 1e-4);
    }
}
