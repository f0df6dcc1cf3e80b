//! Where the picture is taken from.

use crate::Line;
use glam::{Mat4, Vec3, Vec4};

/// A view and a projection.
///
/// World and view space are right-handed; in view space x points right, y up, and the camera looks along −z. Clip space
/// is Vulkan's, with *reversed* depth: y points down the screen, depth is 1 at the near plane and falls towards 0 with
/// distance (which keeps a float's precision where it is needed). The aspect ratio is part of the projection, so a
/// camera belongs to pictures of one shape.
///
/// # Examples
/// ```
/// use glam::{Vec3, Vec4};
/// use vk_render::Camera;
///
/// let camera = Camera::perspective(Vec3::new(0.0, 0.0, 5.0), Vec3::ZERO, Vec3::Y, 0.8, 16.0 / 9.0, 0.1);
/// let centre = camera.projection * camera.view * Vec4::new(0.0, 0.0, 0.0, 1.0);
/// assert_eq!((centre.x, centre.y, centre.w), (0.0, 0.0, 5.0));
/// assert!((centre.z / centre.w - 0.1 / 5.0).abs() < 1e-6);
/// assert!((camera.eye() - Vec3::new(0.0, 0.0, 5.0)).length() < 1e-5);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// World to view space.
    pub view: Mat4,
    /// View space to clip space.
    pub projection: Mat4,
}

impl Camera {
    /// A perspective camera at `eye` that looks at `target`, with `up` upwards in the picture and no far plane.
    ///
    /// `up` must not point along the line of sight.
    ///
    /// # Units
    /// `vertical_fov` is the whole angle in radians, `aspect` width over height, `near` a distance in model units.
    pub fn perspective(
        eye: Vec3,
        target: Vec3,
        up: Vec3,
        vertical_fov: f32,
        aspect: f32,
        near: f32,
    ) -> Self {
        Self {
            view: look_at(eye, target, up),
            projection: Self::perspective_projection(vertical_fov, aspect, near),
        }
    }

    /// The projection of [`Camera::perspective`] alone.
    pub fn perspective_projection(vertical_fov: f32, aspect: f32, near: f32) -> Mat4 {
        let f = 1.0 / (vertical_fov * 0.5).tan();
        Mat4::from_cols(
            Vec4::new(f / aspect, 0.0, 0.0, 0.0),
            Vec4::new(0.0, -f, 0.0, 0.0),
            Vec4::new(0.0, 0.0, 0.0, -1.0),
            Vec4::new(0.0, 0.0, near, 0.0),
        )
    }

    /// A parallel projection: a box `height` model units high, seen from `eye` to `far` units beyond it.
    pub fn parallel(eye: Vec3, target: Vec3, up: Vec3, height: f32, aspect: f32, far: f32) -> Self {
        let projection = Mat4::from_cols(
            Vec4::new(2.0 / (height * aspect), 0.0, 0.0, 0.0),
            Vec4::new(0.0, -2.0 / height, 0.0, 0.0),
            Vec4::new(0.0, 0.0, 1.0 / far, 0.0),
            Vec4::new(0.0, 0.0, 1.0, 1.0),
        );
        Self { view: look_at(eye, target, up), projection }
    }

    /// Where the camera stands, in world space.
    pub fn eye(&self) -> Vec3 {
        self.view.inverse().transform_point3(Vec3::ZERO)
    }

    /// The corners of what a perspective camera sees, in world space: four at the near plane, then four at distance
    /// `far` before the camera, each from the upper left on clockwise.
    pub fn frustum_corners(&self, far: f32) -> [Vec3; 8] {
        let inverse = (self.projection * self.view).inverse();
        // The projection says which depth lies `far` away, whatever kind it is.
        let at_far = self.projection * Vec4::new(0.0, 0.0, -far, 1.0);
        let far_depth = at_far.z / at_far.w;
        let corner = |x: f32, y: f32, depth: f32| {
            let p = inverse * Vec4::new(x, y, depth, 1.0);
            p.truncate() / p.w
        };
        let square = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        std::array::from_fn(|i| {
            let (x, y) = square[i % 4];
            corner(x, y, if i < 4 { 1.0 } else { far_depth })
        })
    }

    /// The edges of [`Camera::frustum_corners`], to be drawn from another camera.
    pub fn frustum_lines(&self, far: f32, rgba: [u8; 4]) -> [Line; 12] {
        let corners = self.frustum_corners(far);
        std::array::from_fn(|i| {
            let (a, b) = match i / 4 {
                0 => (i % 4, (i + 1) % 4),
                1 => (4 + i % 4, 4 + (i + 1) % 4),
                _ => (i % 4, 4 + i % 4),
            };
            Line { a: corners[a], b: corners[b], rgba }
        })
    }
}

fn look_at(eye: Vec3, target: Vec3, up: Vec3) -> Mat4 {
    let back = (eye - target).normalize();
    let right = up.cross(back).normalize();
    let up = back.cross(right);
    Mat4::from_cols(
        Vec4::new(right.x, up.x, back.x, 0.0),
        Vec4::new(right.y, up.y, back.y, 0.0),
        Vec4::new(right.z, up.z, back.z, 0.0),
        Vec4::new(-right.dot(eye), -up.dot(eye), -back.dot(eye), 1.0),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_above_comes_first_on_the_screen() {
        let camera = Camera::perspective(Vec3::Z * 3.0, Vec3::ZERO, Vec3::Y, 1.0, 1.0, 0.1);
        let above = (camera.projection * camera.view).project_point3(Vec3::new(0.5, 1.0, 0.0));
        assert!(above.y < 0.0 && above.x > 0.0);
    }

    #[test]
    fn nearer_is_deeper() {
        for camera in [
            Camera::perspective(Vec3::Z * 3.0, Vec3::ZERO, Vec3::Y, 1.0, 1.0, 0.1),
            Camera::parallel(Vec3::Z * 3.0, Vec3::ZERO, Vec3::Y, 2.0, 1.0, 10.0),
        ] {
            let depth = |z: f32| (camera.projection * camera.view).project_point3(Vec3::Z * z).z;
            assert!(1.0 >= depth(2.0) && depth(2.0) > depth(-2.0) && depth(-2.0) >= 0.0);
        }
    }

    #[test]
    fn the_frustum_ends_where_asked() {
        let camera = Camera::perspective(Vec3::ZERO, -Vec3::Z, Vec3::Y, 1.2, 1.5, 0.25);
        let corners = camera.frustum_corners(8.0);
        for (i, corner) in corners.iter().enumerate() {
            let distance = if i < 4 { 0.25 } else { 8.0 };
            assert!((corner.z + distance).abs() < distance * 1e-4, "corner {i} is {corner}");
        }
        assert!(corners[4].x < 0.0 && corners[4].y > 0.0, "the upper left comes first");
        assert_eq!(camera.frustum_lines(8.0, [0; 4]).len(), 12);
    }
}
