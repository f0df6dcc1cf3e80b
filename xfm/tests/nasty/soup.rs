//! Triangles by their places: whether they are closed, and whether they are the same.

use std::collections::{BTreeSet, HashMap};

use glam::Vec3;
use mesh_io::Triangle;

type Place = [u32; 3];

fn places(triangle: &Triangle) -> [Place; 3] {
    triangle.map(|corner| (corner + Vec3::ZERO).to_array().map(f32::to_bits))
}

/// Those with three corners at different places, all of them finite.
pub fn surface(soup: &[Triangle]) -> Vec<[Place; 3]> {
    let is_finite = |t: &&Triangle| t.iter().all(|corner| corner.is_finite());
    let all = soup.iter().filter(is_finite).map(places);
    all.filter(|[a, b, c]| a != b && b != c && c != a).collect()
}

/// What is a surface, each triangle once, beginning with its least corner.
pub fn surfaces_of(soup: &[Triangle]) -> BTreeSet<[Place; 3]> {
    surface(soup).into_iter().map(|[a, b, c]| [a, b, c].min([b, c, a]).min([c, a, b])).collect()
}

/// How often each edge is there, in either direction.
fn edges(soup: &[Triangle]) -> HashMap<[Place; 2], [u32; 2]> {
    let mut edges: HashMap<[Place; 2], [u32; 2]> = HashMap::new();
    for corners in surface(soup) {
        for i in 0..3 {
            let (a, b) = (corners[i], corners[(i + 1) % 3]);
            let sides = edges.entry(if a < b { [a, b] } else { [b, a] }).or_default();
            sides[usize::from(a < b)] += 1;
        }
    }
    edges
}

/// Whether every edge has one triangle on either side.
pub fn is_watertight(soup: &[Triangle]) -> bool {
    edges(soup).values().all(|&sides| sides == [1, 1])
}

/// Whether every edge has as many triangles on one side as on the other: watertight, but for what has come to one place.
pub fn is_balanced(soup: &[Triangle]) -> bool {
    edges(soup).values().all(|[one, other]| one == other)
}
