//! Which point of the surface a ray meets first.

use glam::Vec3;
use vk_render::Section;

use crate::state::SectionTool;

/// The first point of the triangles on a ray that is not cut away. The direction may have any length.
///
/// # Complexity
/// One test per triangle.
///
/// # Sources
/// Möller and Trumbore, *Fast, Minimum Storage Ray/Triangle Intersection*, 1997.
pub(crate) fn first_hit(
    (eye, direction): (Vec3, Vec3),
    position: impl Fn(u32) -> Option<Vec3>,
    triangles: &[[u32; 3]],
    cut: Option<Section>,
) -> Option<Vec3> {
    let mut nearest = f32::INFINITY;
    for &[a, b, c] in triangles {
        if a == b {
            continue;
        }
        let (Some(a), Some(b), Some(c)) = (position(a), position(b), position(c)) else { continue };
        let (u, v) = (b - a, c - a);
        let p = direction.cross(v);
        let determinant = u.dot(p);
        if determinant == 0.0 {
            continue;
        }
        let from_a = eye - a;
        let s = from_a.dot(p) / determinant;
        if !(0.0..=1.0).contains(&s) {
            continue;
        }
        let q = from_a.cross(u);
        let t = direction.dot(q) / determinant;
        if t < 0.0 || s + t > 1.0 {
            continue;
        }
        let distance = v.dot(q) / determinant;
        if distance > 0.0
            && distance < nearest
            && !SectionTool::cuts(cut, eye + distance * direction)
        {
            nearest = distance;
        }
    }
    nearest.is_finite().then(|| eye + nearest * direction)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_face_is_hit_unless_it_is_cut_away() {
        let corners = [
            Vec3::new(-1.0, -1.0, 0.0),
            Vec3::new(1.0, -1.0, 0.0),
            Vec3::new(0.0, 1.0, 0.0),
            Vec3::new(-1.0, -1.0, 2.0),
            Vec3::new(1.0, -1.0, 2.0),
            Vec3::new(0.0, 1.0, 2.0),
        ];
        let position = |v: u32| corners.get(v as usize).copied();
        let triangles = [[0, 1, 2], [0, 0, 0], [5, 4, 3], [9, 8, 7]];
        let ray = (Vec3::new(0.1, 0.2, 10.0), Vec3::NEG_Z * 3.0);
        let hit = |cut| first_hit(ray, position, &triangles, cut);
        assert!(hit(None).unwrap().distance(Vec3::new(0.1, 0.2, 2.0)) < 1e-5);
        let cut = Section { normal: Vec3::Z, offset: 1.0 };
        assert!(hit(Some(cut)).unwrap().distance(Vec3::new(0.1, 0.2, 0.0)) < 1e-5);
        let behind = (Vec3::new(0.1, 0.2, 10.0), Vec3::Z);
        assert_eq!(first_hit(behind, position, &triangles, None), None);
    }
}
