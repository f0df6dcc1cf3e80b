//! Merge-tree forests of half-edge collapses and their view-dependent active front.

mod build;
mod forest;
mod node;
mod record;
mod store;

pub use build::{BuildOptions, Records, build, collapse_in_independent_sets, vertex_normals};
pub use forest::{BaseMesh, BaseVertex, Forest, ForestError};
pub use node::{HalfEdgeName, HalfEdgeNames, Node, NodeId, OctNormal, SlotId};
pub use record::{CollapseRecord, StarBounds};
pub use store::NodeStore;
