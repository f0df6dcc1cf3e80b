//! The vertex as it lies in memory, here and on the device.

use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};

/// One vertex: 20 bytes.
///
/// # Examples
/// ```
/// use glam::Vec3;
/// use vk_render::Vertex;
///
/// let vertex = Vertex::new(Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.6, 0.0, -0.8), 7);
/// assert!(vertex.normal().dot(Vec3::new(0.6, 0.0, -0.8)) > 0.99999);
/// assert_eq!(vertex.level & 0xff, 7);
/// ```
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Vertex {
    /// In model units.
    pub position: [f32; 3],
    /// The unit normal, folded onto the octahedron and stored as two signed normalised numbers.
    pub normal: [i16; 2],
    /// Low 8 bits: level of detail, 0 for the coarsest, for [`Shading::LevelOfDetail`](crate::Shading::LevelOfDetail).
    /// The upper 24 bits are reserved for a block's colour and ignored today.
    pub level: u32,
}

const _: () = assert!(size_of::<Vertex>() == 20);

impl Vertex {
    /// A vertex with `normal` (of any length; zero counts as +z) packed.
    pub fn new(position: Vec3, normal: Vec3, level: u8) -> Self {
        Self { position: position.to_array(), normal: pack_normal(normal), level: level.into() }
    }

    /// The unit normal, as the shaders see it: within 0.0001 of what was packed.
    pub fn normal(&self) -> Vec3 {
        let folded = Vec2::new(unsnorm(self.normal[0]), unsnorm(self.normal[1]));
        let mut n = folded.extend(1.0 - folded.x.abs() - folded.y.abs());
        let below = (-n.z).max(0.0);
        n.x -= below.copysign(n.x);
        n.y -= below.copysign(n.y);
        n.normalize()
    }
}

/// Projects a direction onto the octahedron |x| + |y| + |z| = 1 and folds its lower half outwards.
fn pack_normal(n: Vec3) -> [i16; 2] {
    let sum = n.x.abs() + n.y.abs() + n.z.abs();
    if !(sum > 0.0 && sum.is_finite()) {
        return [0, 0];
    }
    let mut p = Vec2::new(n.x, n.y) / sum;
    if n.z < 0.0 {
        p = Vec2::new((1.0 - p.y.abs()).copysign(p.x), (1.0 - p.x.abs()).copysign(p.y));
    }
    [snorm(p.x), snorm(p.y)]
}

fn snorm(x: f32) -> i16 {
    (x.clamp(-1.0, 1.0) * 32767.0).round() as i16
}

fn unsnorm(x: i16) -> f32 {
    (f32::from(x) / 32767.0).max(-1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_survive_packing_in_every_direction() {
        for i in -10..=10_i8 {
            for j in -10..=10_i8 {
                for k in -10..=10_i8 {
                    let n = Vec3::new(i.into(), j.into(), k.into());
                    if n == Vec3::ZERO {
                        continue;
                    }
                    let back = Vertex::new(Vec3::ZERO, n, 0).normal();
                    assert!((back - n.normalize()).length() < 1e-4, "{n} came back as {back}");
                }
            }
        }
    }

    #[test]
    fn no_direction_counts_as_up() {
        for n in [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY] {
            assert_eq!(Vertex::new(Vec3::ZERO, n, 0).normal(), Vec3::Z);
        }
    }
}
