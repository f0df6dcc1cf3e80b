//! The names that collapses come with, and the coarsest mesh in them.

use glam::Vec3;
use halfedge::{FaceId, HalfEdgeId, VertexId};
use mergetree::{Colour, OctNormal};

/// Largest name of a vertex.
pub(crate) const MAX_VERTEX: u32 = (1 << 30) - 1;

/// Stands for no half-edge.
pub(crate) const NONE: u32 = u32::MAX;

#[inline]
pub(crate) fn from_option(half_edge: Option<HalfEdgeId>) -> u32 {
    half_edge.map_or(NONE, HalfEdgeId::get)
}

#[inline]
pub(crate) fn to_option(half_edge: u32) -> Option<HalfEdgeId> {
    (half_edge != NONE).then(|| HalfEdgeId::new(half_edge))
}

/// How large names can be.
///
/// The vertices and faces of collapses have names that need be different only among those that are there at the same time:
/// the name of a vertex may be used again once it has been removed, and that of a face once a collapse has removed it.
/// So names are bounded by what is in memory at once, and tables by name are, however long the stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NameBounds {
    /// All names of vertices are below this; at most 2^30.
    pub vertices: u32,
    /// All names of faces are below this; at most 2^32 / 3.
    pub faces: u32,
}

/// What is left after all collapses, in their names.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CoarseMesh {
    /// Its vertices; the file has them in this order.
    pub vertices: Vec<CoarseVertex>,
    /// Its faces; the file has them in this order.
    pub faces: Vec<CoarseFace>,
    /// The colours of its vertices, if vertices [have colours](crate::LinkOptions::colours); else empty.
    pub colours: Vec<Colour>,
}

/// A vertex of the coarsest mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoarseVertex {
    /// Its name.
    pub name: VertexId,
    /// Its position.
    pub position: Vec3,
    /// Its normal.
    pub normal: OctNormal,
}

/// A face of the coarsest mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CoarseFace {
    /// Its name.
    pub name: FaceId,
    /// The vertices its half-edges `3·name`, `3·name + 1` and `3·name + 2` start from.
    pub corners: [VertexId; 3],
}
