//! Cameras, and the paths they take.

use glam::{Mat4, Vec3};

/// A perspective camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Where it is.
    pub eye: Vec3,
    /// The point in the middle of the picture.
    pub at: Vec3,
    /// What points upwards in the picture, not along the line of sight.
    pub up: Vec3,
    /// Vertical angle of view, in radians.
    pub fov_y: f32,
    /// Width of the picture in pixels.
    pub width: u32,
    /// Height of the picture in pixels.
    pub height: u32,
}

impl Default for Camera {
    fn default() -> Self {
        Self {
            eye: Vec3::Z,
            at: Vec3::ZERO,
            up: Vec3::Y,
            fov_y: 45f32.to_radians(),
            width: 1280,
            height: 720,
        }
    }
}

impl Camera {
    /// Width over height.
    pub fn aspect(&self) -> f32 {
        self.width as f32 / self.height.max(1) as f32
    }

    /// World to camera space: right-handed, looking along −z. `up` is replaced where it lies along the line of sight.
    pub fn view_matrix(&self) -> Mat4 {
        let forward = (self.at - self.eye).try_normalize().unwrap_or(Vec3::NEG_Z);
        let up = if forward.cross(self.up).length_squared() > 1e-12 * self.up.length_squared() {
            self.up
        } else {
            forward.any_orthonormal_vector()
        };
        glam::camera::rh::view::look_to_mat4(self.eye, forward, up.normalize_or(Vec3::Y))
    }

    /// Pixels that a length of one covers at distance one.
    pub fn pixels_per_radian(&self) -> f32 {
        0.5 * self.height as f32 / (0.5 * self.fov_y).tan()
    }

    /// The same camera turned so that a box fits the picture, seen along `direction`.
    #[must_use]
    pub fn framing(self, min: Vec3, max: Vec3, direction: Vec3) -> Self {
        let radius = (0.5 * (max - min).length()).max(f32::MIN_POSITIVE);
        let half_fov =
            (0.5 * self.fov_y).min((0.5 * self.fov_y).tan().mul_add(self.aspect(), 0.0).atan());
        let at = 0.5 * (min + max);
        let eye = at - direction.normalize_or(Vec3::NEG_Z) * (radius / half_fov.sin());
        Self { eye, at, ..self }
    }
}

/// A sequence of cameras, one per frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraPath {
    poses: Vec<(Vec3, Vec3, Vec3)>,
}

/// Why a text is not a camera path.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraPathError {
    /// A line has not six or nine numbers.
    #[error("line {line} has {found} numbers, a pose has 6 (eye, at) or 9 (eye, at, up)")]
    NumberCount {
        /// The line, from 1.
        line: usize,
        /// Numbers on it.
        found: usize,
    },
    /// Something is not a finite number.
    #[error("line {line}: {text:?} is not a finite number")]
    Number {
        /// The line, from 1.
        line: usize,
        /// What stands there.
        text: String,
    },
    /// There is no pose.
    #[error("the path has no pose; write one line per pose: eye x y z, at x y z")]
    Empty,
}

impl CameraPath {
    /// The default path: once around a model, from the whole of it down to its surface and back.
    pub fn orbit(min: Vec3, max: Vec3, frames: usize) -> Self {
        let center = 0.5 * (min + max);
        let radius = 0.5 * (max - min).length();
        let poses = (0..frames.max(1))
            .map(|frame| {
                let t = frame as f32 / frames.max(1) as f32;
                let angle = std::f32::consts::TAU * t;
                // From 2.6 radii to 1.1, which is still outside of it, and back, twice.
                let near = 0.5 - 0.5 * (2.0 * angle).cos();
                let distance = radius * (2.6 - 1.5 * near);
                let height = 0.35 * (1.0 - 0.5 * near);
                let direction = Vec3::new(angle.sin(), height, angle.cos()).normalize();
                // Close by, look at the side of the model that is near.
                let at = center + 0.3 * near * radius * direction.with_y(0.3 * angle.sin());
                (center + distance * direction, at, Vec3::Y)
            })
            .collect();
        Self { poses }
    }

    /// Reads a path: one pose per line, six numbers `eye x y z at x y z` or nine with `up x y z`; `#` begins a comment;
    /// blank lines are skipped.
    ///
    /// # Errors
    /// The first line that is not so; see [`CameraPathError`].
    pub fn parse(text: &str) -> Result<Self, CameraPathError> {
        let mut poses = Vec::new();
        for (line, content) in (1..).zip(text.lines()) {
            let content = content.split('#').next().unwrap_or_default();
            let mut numbers = Vec::new();
            for word in content.split(|c: char| c.is_whitespace() || c == ',') {
                if word.is_empty() {
                    continue;
                }
                match word.parse::<f32>() {
                    Ok(number) if number.is_finite() => numbers.push(number),
                    _ => return Err(CameraPathError::Number { line, text: word.to_owned() }),
                }
            }
            let at = |i: usize| Vec3::from_slice(&numbers[i..i + 3]);
            match numbers.len() {
                0 => {}
                6 => poses.push((at(0), at(3), Vec3::Y)),
                9 => poses.push((at(0), at(3), at(6))),
                found => return Err(CameraPathError::NumberCount { line, found }),
            }
        }
        if poses.is_empty() { Err(CameraPathError::Empty) } else { Ok(Self { poses }) }
    }

    /// The path as text that [`parse`](Self::parse) reads back exactly.
    pub fn to_text(&self) -> String {
        let numbers = |v: Vec3| format!("{} {} {}", v.x, v.y, v.z);
        self.poses
            .iter()
            .map(|&(eye, at, up)| format!("{} {} {}\n", numbers(eye), numbers(at), numbers(up)))
            .collect()
    }

    /// Appends the pose of a camera.
    pub fn push(&mut self, camera: &Camera) {
        self.poses.push((camera.eye, camera.at, camera.up));
    }

    /// Number of poses.
    pub fn len(&self) -> usize {
        self.poses.len()
    }

    /// Whether there is no pose.
    pub fn is_empty(&self) -> bool {
        self.poses.is_empty()
    }

    /// The camera `lens` at the share `t` of the path, 0 to 1, between poses in a straight line.
    ///
    /// # Panics
    /// When the path is empty.
    pub fn camera(&self, t: f32, lens: &Camera) -> Camera {
        let last = self.poses.len() - 1;
        let place = t.clamp(0.0, 1.0) * last as f32;
        let index = (place as usize).min(last.saturating_sub(1));
        let (a, b) = (self.poses[index], self.poses[(index + 1).min(last)]);
        let s = place - index as f32;
        Camera { eye: a.0.lerp(b.0, s), at: a.1.lerp(b.1, s), up: a.2.lerp(b.2, s), ..*lens }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_survive_as_text() {
        let path = CameraPath::orbit(Vec3::ZERO, Vec3::ONE, 30);
        assert_eq!(path.len(), 30);
        assert_eq!(CameraPath::parse(&path.to_text()), Ok(path));
    }

    #[test]
    fn bad_lines_are_named() {
        assert_eq!(CameraPath::parse("# nothing\n\n"), Err(CameraPathError::Empty));
        assert_eq!(
            CameraPath::parse("0 0 0 1 1 1\n1 2 3"),
            Err(CameraPathError::NumberCount { line: 2, found: 3 })
        );
        assert_eq!(
            CameraPath::parse("0 0 inf 1 1 1"),
            Err(CameraPathError::Number { line: 1, text: "inf".into() })
        );
    }

    #[test]
    fn between_poses_the_camera_moves_straight() {
        let path = CameraPath::parse("0 0 0 0 0 1\n2 0 0 2 0 1\n4 4 0 2 0 1").unwrap();
        let lens = Camera::default();
        assert_eq!(path.camera(0.25, &lens).eye, Vec3::X);
        assert_eq!(path.camera(1.0, &lens).eye, Vec3::new(4.0, 4.0, 0.0));
        assert_eq!(CameraPath::parse("1 2 3 4 5 6").unwrap().camera(0.7, &lens).eye.z, 3.0);
    }

    #[test]
    fn framing_puts_the_box_into_the_picture() {
        let camera = Camera::default().framing(Vec3::splat(-1.0), Vec3::splat(3.0), Vec3::ONE);
        let view = camera.view_matrix();
        let projection =
            glam::camera::rh::proj::directx::perspective(camera.fov_y, camera.aspect(), 0.1, 100.0);
        for i in 0..8 {
            let corner =
                Vec3::from_array([0, 1, 2].map(|k| if i >> k & 1 == 1 { 3.0 } else { -1.0 }));
            let p = (projection * view).project_point3(corner);
            assert!(p.x.abs() <= 1.0 && p.y.abs() <= 1.0, "{p}");
        }
    }
}
