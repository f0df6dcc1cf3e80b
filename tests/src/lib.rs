//! What the end-to-end tests share: generated models, and ways to compare meshes.

use glam::Vec3;
use halfedge::{HalfEdgeMesh, Repaired, repair};
use mergetree::{BuildOptions, Forest, build};
use xtask::generate::{Generator, Options, Shape};

/// A generated model as it comes out of the repair: a manifold with positions.
///
/// # Panics
/// When it can't be generated.
pub fn model(shape: Shape, triangles: u64, holes: f64) -> Repaired {
    let mut options = Options::new(shape, triangles);
    options.holes = holes;
    let generator = Generator::new(&options).expect("valid options");
    let mut positions = Vec::new();
    generator
        .triangles(&mut |batch| {
            positions.extend(batch.iter().flatten().map(|&p| Vec3::from_array(p)));
            Ok(())
        })
        .expect("nothing is written that could fail");
    let soup: Vec<[u32; 3]> =
        (0..positions.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    repair(&positions, &soup).expect("indices are in range")
}

/// The forest of a model with the default options.
///
/// # Panics
/// When it is too large.
pub fn forest(model: &Repaired) -> Forest {
    build(model.mesh.clone(), &model.positions, &BuildOptions::default(), &|_| ()).expect("small")
}

/// The bits of every triangle's coordinates, each triangle turned to begin with its least corner, sorted: equal for
/// meshes that are equal as sets of oriented triangles.
pub fn triangle_set(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<[[u32; 3]; 3]> {
    let mut set: Vec<_> = triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| positions[v as usize].to_array().map(f32::to_bits));
            [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap_or([a, b, c])
        })
        .collect();
    set.sort_unstable();
    set
}

/// The triangles of a mesh.
pub fn triangles(mesh: &HalfEdgeMesh) -> Vec<[u32; 3]> {
    mesh.faces().filter_map(|f| mesh.corners(f)).map(|t| t.map(|v| v.get())).collect()
}

/// Vertices − edges + faces, and the number of boundary edges, of triangles that must form a manifold.
///
/// # Panics
/// When they do not.
pub fn topology(num_vertices: usize, triangles: &[[u32; 3]]) -> (i64, usize) {
    let mesh = HalfEdgeMesh::from_triangles(num_vertices, triangles).expect("a manifold");
    let boundary = mesh.half_edges().filter(|&h| mesh.reverse(h).is_none()).count();
    let edges = (3 * triangles.len() + boundary) / 2;
    (num_vertices as i64 - edges as i64 + triangles.len() as i64, boundary)
}

/// What `cargo metadata` says of the workspace's own packages.
///
/// # Panics
/// When cargo does not say it.
pub fn packages() -> Vec<serde_json::Value> {
    let output = std::process::Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("cargo runs");
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    metadata["packages"].as_array().expect("a list").clone()
}
