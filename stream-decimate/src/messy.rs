//! A mesh for tests that has been in an accident.

use glam::{Vec3, vec3};
use mesh_io::{Colour, Triangle};

/// A sheet with holes, some of its triangles later than they should be, some of them at wrong places.
pub(crate) fn sheet(rows: usize, holes: usize, mess: &[usize]) -> Vec<Triangle> {
    let at = |x: usize, y: usize| {
        let (x, y) = (x as f32, y as f32);
        vec3(x, y, (0.3 * x).sin() + (0.2 * y).cos())
    };
    let mut triangles = Vec::new();
    for y in 0..rows {
        for x in (0..20).filter(|x| (x + 20 * y) % holes != 0) {
            let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| at(x + i, y + j));
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    for &i in mess {
        let len = triangles.len();
        triangles.swap(i % len, i / 7 % len);
        triangles[i / 3 % len][i % 3] = at(i % 20, i % rows);
        triangles[i / 5 % len].swap(0, 1);
        if i % 11 == 0 {
            triangles[i / 13 % len][0] = Vec3::NAN;
        }
    }
    triangles
}

/// A colour that tells where it belongs.
pub(crate) fn colour_at(p: Vec3) -> Colour {
    let mix = |hash: u32, c: &f32| (hash ^ c.to_bits()).wrapping_mul(0x9e37_79b1).rotate_left(9);
    (p + Vec3::ZERO).to_array().iter().fold(7, mix).to_le_bytes()
}
