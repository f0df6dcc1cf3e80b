//! The model of the benchmarks of this crate and of those below it.

use glam::{Vec3, vec3};
use halfedge::HalfEdgeMesh;
use mergetree::{BuildOptions, Forest};

/// The forest of a torus of `2 · n · m` bumpy triangles.
pub fn torus(n: u32, m: u32) -> Forest {
    let positions: Vec<Vec3> = (0..n * m)
        .map(|i| {
            let [a, b] =
                [(i % n, n), (i / n, m)].map(|(i, n)| i as f32 / n as f32 * std::f32::consts::TAU);
            let r = 1.0 + (0.4 + 0.02 * (15.0 * a).sin() * (9.0 * b).cos()) * b.cos();
            vec3(r * a.cos(), r * a.sin(), 0.4 * b.sin())
        })
        .collect();
    let at = |x: u32, y: u32| (y % m) * n + x % n;
    let triangles: Vec<[u32; 3]> = (0..n * m)
        .flat_map(|i| {
            let (x, y) = (i % n, i / n);
            let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    let mesh = HalfEdgeMesh::from_triangles(positions.len(), &triangles).expect("a torus");
    mergetree::build(mesh, &positions, &BuildOptions::default(), &|_| ()).expect("few nodes")
}
