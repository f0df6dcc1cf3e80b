//! The mesh itself: three arrays.

use crate::{FaceId, HalfEdgeId, VertexId};

/// A manifold triangle mesh, with or without boundary, as directed edges.
///
/// Faces and vertices keep their ids for life; a collapse leaves holes in the numbering, its inverse fills them again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HalfEdgeMesh {
    /// Start vertex of every half-edge; `None` in a removed face.
    pub(crate) start: Vec<Option<VertexId>>,
    /// The half-edge of the adjacent face; `None` on the boundary. Kept as it was in a removed face.
    pub(crate) reverse: Vec<Option<HalfEdgeId>>,
    /// One half-edge out of every vertex, the boundary one where there is one; `None` for a vertex without a face.
    pub(crate) outgoing: Vec<Option<HalfEdgeId>>,
    pub(crate) num_faces: usize,
    pub(crate) num_vertices: usize,
}

impl HalfEdgeMesh {
    /// Number of faces present.
    pub fn num_faces(&self) -> usize {
        self.num_faces
    }

    /// Number of vertices that have a face.
    pub fn num_vertices(&self) -> usize {
        self.num_vertices
    }

    /// One more than the largest face id, removed faces included.
    pub fn face_capacity(&self) -> usize {
        self.start.len() / 3
    }

    /// One more than the largest vertex id, removed vertices included.
    pub fn vertex_capacity(&self) -> usize {
        self.outgoing.len()
    }

    /// Whether the face is present.
    #[inline]
    pub fn has_face(&self, f: FaceId) -> bool {
        self.start[3 * f.index()].is_some()
    }

    /// Whether the vertex has a face.
    #[inline]
    pub fn has_vertex(&self, v: VertexId) -> bool {
        self.outgoing[v.index()].is_some()
    }

    /// The vertex a half-edge starts at.
    ///
    /// # Panics
    /// When its face was removed.
    #[inline]
    pub fn start(&self, h: HalfEdgeId) -> VertexId {
        self.start[h.index()].expect("half-edge of a removed face")
    }

    /// The vertex a half-edge ends at.
    ///
    /// # Panics
    /// When its face was removed.
    #[inline]
    pub fn end(&self, h: HalfEdgeId) -> VertexId {
        self.start(h.next())
    }

    /// The half-edge that runs the other way in the adjacent face; `None` on the boundary.
    #[inline]
    pub fn reverse(&self, h: HalfEdgeId) -> Option<HalfEdgeId> {
        self.reverse[h.index()]
    }

    /// The corners of a face, counter-clockwise; `None` when it was removed.
    #[inline]
    pub fn corners(&self, f: FaceId) -> Option<[VertexId; 3]> {
        let [a, b, c] = f.half_edges().map(|h| self.start[h.index()]);
        Some([a?, b?, c?])
    }

    /// Whether the vertex lies on the boundary. A vertex without a face does not.
    #[inline]
    pub fn is_boundary_vertex(&self, v: VertexId) -> bool {
        self.outgoing[v.index()].is_some_and(|h| self.reverse[h.index()].is_none())
    }

    /// All faces present, in order of their ids.
    pub fn faces(&self) -> impl Iterator<Item = FaceId> + '_ {
        (0..self.face_capacity()).map(FaceId::from_index).filter(|&f| self.has_face(f))
    }

    /// All vertices that have a face, in order of their ids.
    pub fn vertices(&self) -> impl Iterator<Item = VertexId> + '_ {
        (0..self.vertex_capacity()).map(VertexId::from_index).filter(|&v| self.has_vertex(v))
    }

    /// All half-edges of faces present, in order of their ids.
    pub fn half_edges(&self) -> impl Iterator<Item = HalfEdgeId> + '_ {
        self.faces().flat_map(FaceId::half_edges)
    }
}
