//! A camera that turns around a point, walks, and looks about.

use std::f32::consts::FRAC_PI_2;

use glam::{Quat, Vec2, Vec3, Vec3Swizzles};
use mergetree::Camera;

use crate::camera::standard::{Standard, Up};

/// A turn or a shift below this share of the window is none.
const LEAST_DISTANCE: f32 = 1e-5;

/// Where the camera is: a point it looks at, a direction and a distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Navigator {
    target: Vec3,
    distance: f32,
    /// To the right, in radians.
    yaw: f32,
    /// Upwards, in radians, from pole to pole.
    pitch: f32,
    up: Up,
    /// The model's.
    bounds: [Vec3; 2],
}

impl Navigator {
    /// The whole model from its front, a little above.
    pub(crate) fn around(bounds: [Vec3; 2], up: Up, lens: &Camera) -> Self {
        let mut navigator =
            Self { target: Vec3::ZERO, distance: 1.0, yaw: 0.6, pitch: 0.3, up, bounds };
        navigator.fit(lens);
        navigator
    }

    /// The camera there.
    pub(crate) fn camera(&self, lens: &Camera) -> Camera {
        let turn = self.rotation();
        // The picture's own up, which is good at the poles too.
        Camera { eye: self.eye(), at: self.target, up: turn * Vec3::Y, ..*lens }
    }

    pub(crate) fn eye(&self) -> Vec3 {
        self.target + self.distance * (self.rotation() * Vec3::Z)
    }

    /// From camera space to the world.
    fn rotation(&self) -> Quat {
        self.up.rotation() * Quat::from_rotation_y(self.yaw) * Quat::from_rotation_x(-self.pitch)
    }

    pub(crate) fn up(&self) -> Up {
        self.up
    }

    fn radius(&self) -> f32 {
        crate::model::radius(self.bounds)
    }

    /// Another axis points upwards; the model is looked at as before.
    pub(crate) fn set_up(&mut self, up: Up, lens: &Camera) {
        *self = Self { up, ..*self };
        self.fit(lens);
    }

    /// The whole model, from where the camera looks.
    pub(crate) fn fit(&mut self, lens: &Camera) {
        let [min, max] = self.bounds;
        let framed = lens.framing(min, max, self.rotation() * Vec3::NEG_Z);
        self.target = framed.at;
        self.distance = framed.eye.distance(framed.at).max(f32::MIN_POSITIVE);
    }

    /// The whole model along an axis.
    pub(crate) fn stand(&mut self, view: Standard, lens: &Camera) {
        (self.yaw, self.pitch) = view.angles();
        self.fit(lens);
    }

    /// Goes where a camera is, as well as a camera that stands upright can.
    pub(crate) fn go_to(&mut self, camera: &Camera) {
        let sight = self.up.rotation().inverse() * (camera.eye - camera.at);
        self.distance = sight.length().max(LEAST_DISTANCE * self.radius());
        let sight = sight.try_normalize().unwrap_or(Vec3::Z);
        self.pitch = sight.y.clamp(-1.0, 1.0).asin();
        if sight.xz().length_squared() > 1e-10 {
            self.yaw = sight.x.atan2(sight.z);
        } else {
            // Straight down or up: what is upwards in the picture says where forward is.
            let up = self.up.rotation().inverse() * camera.up * -sight.y.signum();
            self.yaw = up.x.atan2(up.z);
        }
        self.target = camera.at;
    }

    /// Turns around the point looked at by a drag, as a share of the window's height.
    pub(crate) fn turn(&mut self, drag: Vec2) {
        self.yaw -= 4.0 * drag.x;
        self.pitch = (self.pitch + 4.0 * drag.y).clamp(-FRAC_PI_2, FRAC_PI_2);
    }

    /// Looks about from where the camera is.
    pub(crate) fn look(&mut self, drag: Vec2, lens: &Camera) {
        let eye = self.eye();
        // What is under the pointer stays there, about.
        self.yaw += drag.x * lens.fov_y;
        self.pitch = (self.pitch - drag.y * lens.fov_y).clamp(-FRAC_PI_2, FRAC_PI_2);
        self.target = eye - self.distance * (self.rotation() * Vec3::Z);
    }

    /// Moves with a drag, as a share of the window's height, so that what is in the middle follows the pointer.
    pub(crate) fn pan(&mut self, drag: Vec2, lens: &Camera) {
        let height = 2.0 * self.distance * (0.5 * lens.fov_y).tan();
        self.target += self.rotation() * (height * Vec3::new(-drag.x, drag.y, 0.0));
    }

    /// Goes nearer to a point by so many notches of a wheel, or away where negative; it stays where it is in the picture.
    pub(crate) fn zoom(&mut self, notches: f32, towards: Vec3) {
        let (nearest, farthest) = (LEAST_DISTANCE * self.radius(), 50.0 * self.radius());
        let distance = (self.distance * 0.88f32.powf(notches)).clamp(nearest, farthest);
        let factor = distance / self.distance;
        self.target = towards + factor * (self.target - towards);
        self.distance = distance;
    }

    /// How near the point looked at is, as a share of the model's radius: whoever looks at something small walks slowly.
    pub(crate) fn nearness(&self) -> f32 {
        (self.distance / self.radius()).clamp(0.01, 1.0)
    }

    /// Walks: to the right, upwards and forwards, in lengths of the model's radius.
    pub(crate) fn walk(&mut self, steps: Vec3) {
        let Vec3 { x, y, z } = steps * self.radius();
        self.target += self.rotation() * Vec3::new(x, 0.0, -z) + self.up.axis() * y;
    }

    /// Turns around another point from now on; it comes to the middle of the picture.
    pub(crate) fn centre_on(&mut self, point: Vec3) {
        self.distance = self.eye().distance(point).max(LEAST_DISTANCE * self.radius());
        self.target = point;
    }

    /// The ray through a place in the picture, in shares of its width and height from the upper left: from the eye, with
    /// a direction that reaches the plane of the point looked at.
    pub(crate) fn ray(&self, place: Vec2, lens: &Camera) -> (Vec3, Vec3) {
        let half = (0.5 * lens.fov_y).tan();
        let x = (2.0 * place.x - 1.0) * half * lens.aspect();
        let y = (1.0 - 2.0 * place.y) * half;
        (self.eye(), self.rotation() * (self.distance * Vec3::new(x, y, -1.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn navigator(up: Up) -> (Navigator, Camera) {
        let lens = Camera::default();
        (Navigator::around([Vec3::NEG_ONE, Vec3::ONE], up, &lens), lens)
    }

    #[test]
    fn a_drag_to_the_right_turns_the_model_to_the_right() {
        for up in [Up::Y, Up::Z] {
            let (mut at, lens) = navigator(up);
            let front = at.eye().normalize() * 0.5;
            at.turn(Vec2::new(0.05, 0.0));
            let seen = at.camera(&lens).view_matrix().transform_point3(front);
            assert!(seen.x > 0.0);
        }
    }

    #[test]
    fn a_pan_moves_what_is_in_the_middle_with_the_pointer() {
        let (mut at, lens) = navigator(Up::Y);
        at.pan(Vec2::new(0.1, 0.0), &lens);
        let seen = at.camera(&lens).view_matrix().transform_point3(Vec3::ZERO);
        assert!(seen.x > 0.0 && seen.y.abs() < 1e-4);
    }

    #[test]
    fn what_is_zoomed_to_stays_under_the_pointer() {
        let (mut at, lens) = navigator(Up::Z);
        let place = Vec2::new(0.7, 0.2);
        let (eye, direction) = at.ray(place, &lens);
        let point = eye + 0.8 * direction;
        let seen = |at: &Navigator| {
            let p = at.camera(&lens).view_matrix().transform_point3(point);
            p.xy() / p.z
        };
        let before = seen(&at);
        at.zoom(4.0, point);
        assert!((seen(&at) - before).length() < 1e-4);
        assert!(at.eye().distance(point) < 0.61 * eye.distance(point));
        at.zoom(-4.0, point);
        assert!(at.eye().distance(eye) < 1e-3);
    }

    #[test]
    fn looking_about_leaves_the_eye_where_it_is_and_walking_does_not() {
        let (mut at, lens) = navigator(Up::Y);
        let eye = at.eye();
        at.look(Vec2::new(0.3, -0.2), &lens);
        assert!(at.eye().distance(eye) < 1e-4);
        let ahead = at.camera(&lens).at;
        at.walk(Vec3::Z);
        assert!(at.eye().distance(ahead) < eye.distance(ahead));
    }

    #[test]
    fn the_named_views_look_along_the_axes() {
        let (mut at, lens) = navigator(Up::Y);
        let expected = [Vec3::Z, Vec3::NEG_Z, Vec3::NEG_X, Vec3::X, Vec3::Y, Vec3::NEG_Y];
        for (view, expected) in Standard::ALL.into_iter().zip(expected) {
            at.stand(view, &lens);
            assert!((at.eye().normalize() - expected).length() < 1e-5, "{view:?}");
            assert!(at.camera(&lens).view_matrix().is_finite());
        }
        let (mut at, lens) = navigator(Up::Z);
        at.stand(Standard::Front, &lens);
        assert!((at.eye().normalize() - Vec3::NEG_Y).length() < 1e-5);
        at.stand(Standard::Top, &lens);
        assert!((at.eye().normalize() - Vec3::Z).length() < 1e-5);
    }

    #[test]
    fn going_to_a_camera_arrives_there() {
        for up in [Up::Y, Up::Z] {
            let (mut at, lens) = navigator(up);
            let mut views: Vec<Navigator> = vec![at];
            at.turn(Vec2::new(1.3, -0.4));
            views.push(at);
            for view in Standard::ALL {
                at.stand(view, &lens);
                views.push(at);
            }
            for view in views {
                let camera = view.camera(&lens);
                at.go_to(&camera);
                let there = at.camera(&lens);
                assert!(there.eye.distance(camera.eye) < 1e-4, "{up:?} {view:?}");
                assert!(there.up.distance(camera.up) < 1e-3, "{up:?} {view:?}: {}", there.up);
            }
        }
    }
}
