//! The view from outside, with the frustum of the user's camera (first paper, Figure 10, lower row).

use glam::Vec3;
use mergetree::Camera;
use vk_render::Line;

const FRUSTUM_COLOR: [u8; 4] = [255, 214, 64, 255];

/// A camera that sees the whole model, and the user's eye where it is not far off, from the side and a little above.
pub(crate) fn camera(user: &Camera, [min, max]: [Vec3; 2], up: Vec3) -> Camera {
    let sight = (user.at - user.eye).normalize_or(Vec3::NEG_Z);
    let side = sight.cross(up).try_normalize().unwrap_or_else(|| up.any_orthonormal_vector());
    let direction = (0.5 * sight - side - 0.4 * up).normalize();
    let center = 0.5 * (min + max);
    // As much of the way to the eye as leaves the model large.
    let toward_eye = (user.eye - center).clamp_length_max(0.5 * (max - min).length());
    let eye = center + toward_eye;
    let around = Camera { up, ..*user };
    around.framing(min.min(eye), max.max(eye), direction)
}

/// The edges of the user's frustum, from the eye to a little beyond the middle of what it looks at.
pub(crate) fn frustum(user: &Camera, radius: f32) -> Vec<Line> {
    let depth = (1.1 * user.eye.distance(user.at)).max(0.2 * radius);
    let to_world = user.view_matrix().inverse();
    let half_height = depth * (0.5 * user.fov_y).tan();
    let half_width = half_height * user.aspect();
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| {
        to_world.transform_point3(Vec3::new(x * half_width, y * half_height, -depth))
    });
    let line = |a, b| Line { a, b, rgba: FRUSTUM_COLOR };
    (0..4)
        .flat_map(|i| [line(user.eye, corners[i]), line(corners[i], corners[(i + 1) % 4])])
        .collect()
}
