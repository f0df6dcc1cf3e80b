//! Meshes from files.

use std::path::Path;

use mesh_io::{Format, IndexedMesh};

use crate::Error;

/// Reads a whole mesh.
///
/// # Errors
///
/// What is wrong with the file.
pub fn read_mesh(path: &Path, from: Option<Format>) -> Result<IndexedMesh, Error> {
    drop(from);
    Ok(mesh_io::read_mesh(path)?)
}
