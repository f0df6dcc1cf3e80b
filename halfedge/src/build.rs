//! Connectivity from a list of triangles that is known to be manifold.

use crate::pairing::Buckets;
use crate::{HalfEdgeId, HalfEdgeMesh, VertexId};

/// Why triangles do not form a manifold mesh. [`crate::repair`] takes any triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// A corner names a vertex that is not there.
    #[error("triangle {triangle} names vertex {vertex}, but there are {num_vertices} vertices")]
    VertexOutOfRange {
        /// Index of the triangle.
        triangle: usize,
        /// The vertex named.
        vertex: u32,
        /// Number of vertices.
        num_vertices: usize,
    },
    /// A triangle names a vertex twice.
    #[error("triangle {triangle} names a vertex twice; repair the mesh first")]
    Degenerate {
        /// Index of the triangle.
        triangle: usize,
    },
    /// Two triangles run along an edge in the same direction.
    #[error(
        "the edge from vertex {from} to {to} is used twice in this direction; repair the mesh first"
    )]
    NonManifoldEdge {
        /// Start of the edge.
        from: u32,
        /// End of the edge.
        to: u32,
    },
    /// The faces around a vertex do not form one fan.
    #[error("the faces around vertex {vertex} form several fans; repair the mesh first")]
    NonManifoldVertex {
        /// The vertex.
        vertex: u32,
    },
}

impl HalfEdgeMesh {
    /// Connects triangles that form a manifold.
    ///
    /// # Complexity
    /// Time and memory linear in the number of triangles and vertices.
    ///
    /// # Errors
    /// Every way in which the triangles are not an oriented manifold; see [`BuildError`].
    pub fn from_triangles(num_vertices: usize, triangles: &[[u32; 3]]) -> Result<Self, BuildError> {
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= num_vertices) {
                return Err(BuildError::VertexOutOfRange { triangle, vertex, num_vertices });
            }
            let [a, b, c] = *corners;
            if a == b || b == c || c == a {
                return Err(BuildError::Degenerate { triangle });
            }
        }
        let buckets = Buckets::by_start(num_vertices, triangles);
        if let Some((from, to)) = buckets.repeated_edge() {
            return Err(BuildError::NonManifoldEdge { from, to });
        }
        let reverse = (0..3 * triangles.len())
            .map(|h| {
                let h = HalfEdgeId::from_index(h);
                let (from, to) = buckets.edge(h);
                buckets.leaving(to).iter().copied().find(|&g| buckets.edge(g).1 == from)
            })
            .collect();
        Self::from_pairing(num_vertices, triangles, reverse)
    }

    /// Connects triangles whose reverse half-edges are known and consistent.
    fn from_pairing(
        num_vertices: usize,
        triangles: &[[u32; 3]],
        reverse: Vec<Option<HalfEdgeId>>,
    ) -> Result<Self, BuildError> {
        let start: Vec<_> =
            triangles.as_flattened().iter().map(|&v| Some(VertexId::new(v))).collect();
        let mut outgoing = vec![None; num_vertices];
        let mut degree = vec![0u32; num_vertices];
        for (index, &v) in triangles.as_flattened().iter().enumerate() {
            degree[v as usize] += 1;
            if outgoing[v as usize].is_none() || reverse[index].is_none() {
                outgoing[v as usize] = Some(HalfEdgeId::from_index(index));
            }
        }
        let mesh = Self {
            start,
            reverse,
            num_faces: triangles.len(),
            num_vertices: outgoing.iter().flatten().count(),
            outgoing,
        };
        for (vertex, &degree) in degree.iter().enumerate() {
            let v = VertexId::from_index(vertex);
            if mesh.outgoing(v).take(degree as usize + 1).count() != degree as usize {
                return Err(BuildError::NonManifoldVertex { vertex: v.get() });
            }
        }
        Ok(mesh)
    }
}
