//! Directed-edge connectivity of triangle meshes.
//!
//! A triangle `f` owns the half-edges `3f`, `3f + 1`, `3f + 2`, so *next* and *previous* are arithmetic and only the
//! start vertex and the reverse half-edge are stored (Campagna, Kobbelt and Seidel, *Directed Edges*, 1998). On top of
//! it stand one-ring walks, the half-edge collapse with its exact inverse, and the repair of dirty input into a
//! manifold. The mesh knows no positions; only [`repair`] looks at them, to weld vertices and to pair sheets.
//!
//! Conventions: triangles are counter-clockwise seen from outside; an edge without a reverse half-edge is boundary; a
//! vertex has at most one boundary edge going out and one coming in.
//!
//! ```
//! use halfedge::{HalfEdgeMesh, VertexId};
//!
//! // An octahedron: collapse one vertex, take it back.
//! let triangles =
//!     [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1], [5, 2, 1], [5, 3, 2], [5, 4, 3], [5, 1, 4]];
//! let mut mesh = HalfEdgeMesh::from_triangles(6, &triangles)?;
//! let before = mesh.clone();
//! let h = mesh.outgoing(VertexId::new(0)).next().unwrap();
//! let collapse = mesh.check_collapse(h).unwrap();
//! mesh.apply(&collapse);
//! assert_eq!(mesh.num_faces(), 6);
//! mesh.validate().unwrap();
//! mesh.undo(&collapse);
//! assert_eq!(mesh, before);
//! # Ok::<(), halfedge::BuildError>(())
//! ```

mod build;
mod collapse;
mod ids;
mod mesh;
mod pairing;
mod repair;
mod traverse;
mod validate;

pub use build::BuildError;
pub use collapse::{Collapse, CollapseRejected};
pub use ids::{FaceId, HalfEdgeId, VertexId};
pub use mesh::HalfEdgeMesh;
pub use repair::{RepairReport, Repaired, repair};
pub use traverse::Outgoing;
pub use validate::Invalid;
