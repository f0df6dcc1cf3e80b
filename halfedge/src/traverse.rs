//! Walks around a vertex.

use crate::{HalfEdgeId, HalfEdgeMesh, VertexId};

/// The half-edges out of a vertex, one per incident face, counter-clockwise seen from outside.
///
/// Around a boundary vertex the walk begins at the boundary edge going out and ends in the face of the boundary edge
/// coming in.
#[derive(Clone, Debug)]
pub struct Outgoing<'a> {
    mesh: &'a HalfEdgeMesh,
    first: Option<HalfEdgeId>,
    current: Option<HalfEdgeId>,
}

impl Iterator for Outgoing<'_> {
    type Item = HalfEdgeId;

    #[inline]
    fn next(&mut self) -> Option<HalfEdgeId> {
        let h = self.current?;
        let turned = self.mesh.reverse(h.prev());
        self.current = if turned == self.first { None } else { turned };
        Some(h)
    }
}

impl HalfEdgeMesh {
    /// The half-edges out of `v`. Empty for a vertex without a face.
    #[inline]
    pub fn outgoing(&self, v: VertexId) -> Outgoing<'_> {
        let first = self.outgoing[v.index()];
        Outgoing { mesh: self, first, current: first }
    }

    /// The one-ring of `v`: its neighbours, counter-clockwise; on the boundary from the neighbour along the outgoing
    /// boundary edge to the one along the incoming boundary edge.
    pub fn one_ring(&self, v: VertexId) -> impl Iterator<Item = VertexId> + '_ {
        let last = self.outgoing(v).last().filter(|h| self.reverse(h.prev()).is_none());
        self.outgoing(v).map(|h| self.end(h)).chain(last.map(|h| self.start(h.prev())))
    }

    /// Number of neighbours of `v`.
    ///
    /// # Complexity
    /// Time linear in the result.
    pub fn valence(&self, v: VertexId) -> usize {
        self.outgoing(v).count() + usize::from(self.is_boundary_vertex(v))
    }

    /// The half-edge from `a` to `b`, if there is one.
    ///
    /// # Complexity
    /// Time linear in the valence of `a`.
    pub fn find_half_edge(&self, a: VertexId, b: VertexId) -> Option<HalfEdgeId> {
        self.outgoing(a).find(|&h| self.end(h) == b)
    }
}
