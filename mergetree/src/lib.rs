//! Merge-tree forests of half-edge collapses and their view-dependent active front.
//!
//! A mesh is collapsed, one half-edge at a time, until almost nothing is left. Every collapse becomes a node: its left
//! child is the last collapse into the vertex it removes, its right child the last one into the vertex it keeps. The
//! [`Forest`] of these nodes holds every level of detail at once; a [`Front`] is a cut through it, and the triangle mesh
//! that belongs to the cut is updated in place as nodes are split and collapsed again.
//!
//! The front reads nodes through [`NodeStore`], so that a forest may be in memory or in a file that is paged.
//!
//! Conventions: triangles are counter-clockwise seen from outside; lengths are the model's; angles are radians; errors
//! are whatever the caller's error function says, pixels for a [`View`].
//!
//! ```
//! use glam::Vec3;
//! use halfedge::HalfEdgeMesh;
//! use mergetree::{BuildOptions, Dependencies, Front, UpdateLimits};
//!
//! // A sheet of 40 × 40 quads over a hill.
//! let n = 40u32;
//! let positions: Vec<Vec3> = (0..(n + 1) * (n + 1))
//!     .map(|i| Vec3::new((i % (n + 1)) as f32, (i / (n + 1)) as f32, 0.0))
//!     .map(|p| p.with_z((0.2 * p.x).sin() * (0.2 * p.y).sin()))
//!     .collect();
//! let triangles: Vec<[u32; 3]> = (0..n * n)
//!     .map(|q| q % n + q / n * (n + 1))
//!     .flat_map(|a| [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]])
//!     .collect();
//!
//! let mesh = HalfEdgeMesh::from_triangles(positions.len(), &triangles).unwrap();
//! let mut forest =
//!     mergetree::build(mesh, &positions, &BuildOptions::default(), &|_| ()).unwrap();
//! let mut front = Front::new(&forest, Dependencies::Order).unwrap();
//! let coarse = front.num_triangles();
//!
//! // Refine to a hundredth of a unit, then to nothing at all.
//! front.update(&mut forest, |node| node.deviation, &UpdateLimits::with_tolerance(0.01));
//! assert!(coarse < front.num_triangles() && front.num_triangles() < triangles.len());
//! front.update(&mut forest, |_| 1.0, &UpdateLimits::with_tolerance(0.0));
//! assert_eq!(front.num_triangles(), triangles.len());
//! front.validate(&forest).unwrap();
//! ```

mod bounds;
mod build;
mod camera;
mod cut;
mod forest;
mod front;
mod measure;
mod node;
mod pack;
mod ranks;
mod record;
mod store;
mod view;

pub use bounds::{BoundCodes, Bounded};
pub use build::{BuildOptions, Records, build, collapse_in_independent_sets, vertex_normals};
pub use camera::{Camera, CameraPath, CameraPathError};
pub use cut::{Cut, CutRule, OpenPiece};
pub use forest::{BaseMesh, BaseVertex, Forest, ForestError};
pub use front::{
    Changes, CollapseBlocked, Dependencies, Front, FrontInvalid, FrontVertex, SplitBlocked,
    UpdateLimits, UpdateStats,
};
pub use measure::{BoundsLanes, ErrorMeasure, LANES, NodeBounds};
pub use node::{Colour, HalfEdgeName, HalfEdgeNames, Node, NodeId, OctNormal, SlotId};
pub use pack::{DraftPlace, PackedPage, PackedPages, PagePacker};
pub use ranks::{RankAccount, RankError, ranks};
pub use record::{CollapseRecord, StarBounds};
pub use store::NodeStore;
pub use view::{ToleranceControl, View, ViewTest};
