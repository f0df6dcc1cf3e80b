//! The in-core builder: from a manifold mesh to collapse records and the forest.

mod geometry;
mod independent_sets;
mod normals;
mod radix;

pub use independent_sets::{BuildOptions, Records, collapse_in_independent_sets};
pub use normals::vertex_normals;

use glam::Vec3;
use halfedge::HalfEdgeMesh;

use crate::{Forest, ForestError};

/// Builds the forest of a mesh in memory: [`collapse_in_independent_sets`], then [`Forest::from_records`].
///
/// The result depends on the input and the options only, not on the number of threads.
///
/// # Complexity
/// Time and memory linear in the number of faces.
///
/// # Errors
/// As [`Forest::from_records`].
///
/// # Panics
/// When a vertex has no position.
pub fn build(
    mesh: HalfEdgeMesh,
    positions: &[Vec3],
    options: &BuildOptions,
    progress: &dyn Fn(f32),
) -> Result<Forest, ForestError> {
    let normals = vertex_normals(&mesh, positions);
    let Records { records, coarse } =
        collapse_in_independent_sets(mesh, positions, &normals, options, progress);
    Forest::from_records(&records, &coarse, positions, &normals)
}
