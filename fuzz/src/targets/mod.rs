//! All targets.

mod build;
mod decimate;
mod mesh;
mod soup;
mod xfm;

use crate::Target;

/// All of them: `.xfm` files, each mesh format, what is packed, decimation, building.
pub const ALL: [Target; 9] = [
    xfm::TARGET,
    mesh::STL,
    mesh::PLY,
    mesh::OBJ,
    mesh::GLTF,
    mesh::PACKED,
    decimate::TARGET,
    decimate::COLLAPSE,
    build::TARGET,
];
