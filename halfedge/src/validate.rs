//! The invariants of the mesh, checked one by one.

use crate::{FaceId, HalfEdgeId, HalfEdgeMesh, VertexId};

/// The first invariant found broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Invalid {
    /// Some corners of a face are present and some are not.
    #[error("face {0} is half removed")]
    TornFace(FaceId),
    /// A face names a vertex twice.
    #[error("face {0} names a vertex twice")]
    DegenerateFace(FaceId),
    /// A reverse half-edge does not point back, belongs to a removed face or does not run between the same vertices.
    #[error("the reverse of half-edge {0} does not match it")]
    Reverse(HalfEdgeId),
    /// A vertex names a half-edge that does not leave it, or one that is not the boundary edge of a boundary vertex.
    #[error("vertex {0} names a wrong half-edge")]
    Outgoing(VertexId),
    /// The walk around a vertex does not meet all faces that have it as a corner.
    #[error("the faces around vertex {0} form several fans")]
    Fan(VertexId),
    /// A stored count is wrong.
    #[error("the mesh counts {stored} {what}, there are {found}")]
    Count {
        /// What is counted.
        what: &'static str,
        /// Number stored.
        stored: usize,
        /// Number found.
        found: usize,
    },
}

impl HalfEdgeMesh {
    /// Checks every invariant.
    ///
    /// # Complexity
    /// Time and memory linear in the capacity of the mesh.
    ///
    /// # Errors
    /// The first broken invariant, in order of faces, then vertices, then counts.
    pub fn validate(&self) -> Result<(), Invalid> {
        let mut degree = vec![0usize; self.vertex_capacity()];
        let mut num_faces = 0;
        for f in (0..self.face_capacity()).map(FaceId::from_index) {
            let present = f.half_edges().map(|h| self.start[h.index()].is_some());
            if present == [false; 3] {
                continue;
            }
            let Some([a, b, c]) = self.corners(f) else { return Err(Invalid::TornFace(f)) };
            if a == b || b == c || c == a {
                return Err(Invalid::DegenerateFace(f));
            }
            num_faces += 1;
            for h in f.half_edges() {
                degree[self.start(h).index()] += 1;
                let matches = self.reverse(h).is_none_or(|r| {
                    self.has_face(r.face())
                        && self.reverse(r) == Some(h)
                        && self.start(r) == self.end(h)
                        && self.end(r) == self.start(h)
                });
                if !matches {
                    return Err(Invalid::Reverse(h));
                }
            }
        }
        let mut num_vertices = 0;
        for (index, &degree) in degree.iter().enumerate() {
            let v = VertexId::from_index(index);
            match self.outgoing[index] {
                None if degree == 0 => continue,
                None => return Err(Invalid::Outgoing(v)),
                Some(h) if self.start[h.index()] != Some(v) => return Err(Invalid::Outgoing(v)),
                Some(_) => num_vertices += 1,
            }
            // A boundary half-edge that the walk does not begin at would end it early, and the fan would not be whole.
            if self.outgoing(v).take(degree + 1).count() != degree {
                return Err(Invalid::Fan(v));
            }
        }
        for (what, stored, found) in
            [("faces", self.num_faces, num_faces), ("vertices", self.num_vertices, num_vertices)]
        {
            if stored != found {
                return Err(Invalid::Count { what, stored, found });
            }
        }
        Ok(())
    }
}
