//! Pages the nodes of a `.xfm` file in and out under a memory quota.
//!
//! [`Pager`] is the [`mergetree::NodeStore`] of a forest that need not fit into memory. Each frame:
//! [`Pager::begin_frame`], then [`mergetree::Front::update`], which requests the nodes that the view wants. [`Session`] does
//! both for a camera, and chooses the tolerance.
//!
//! ```
//! use glam::Vec3;
//! use halfedge::HalfEdgeMesh;
//! use mergetree::{BuildOptions, Dependencies, Front, UpdateLimits};
//! use xfm_pager::{Pager, PagerOptions};
//!
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("hill.xfm");
//! // A sheet of 40 × 40 quads over a hill, in a file.
//! let n = 40u32;
//! let positions: Vec<Vec3> = (0..(n + 1) * (n + 1))
//!     .map(|i| Vec3::new((i % (n + 1)) as f32, (i / (n + 1)) as f32, 0.0))
//!     .map(|p| p.with_z((0.2 * p.x).sin() * (0.2 * p.y).sin()))
//!     .collect();
//! let triangles: Vec<[u32; 3]> = (0..n * n)
//!     .map(|q| q % n + q / n * (n + 1))
//!     .flat_map(|a| [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]])
//!     .collect();
//! let mesh = HalfEdgeMesh::from_triangles(positions.len(), &triangles)?;
//! let forest = mergetree::build(mesh, &positions, &BuildOptions::default(), &|_| ())?;
//! xfm_format::write(&forest, &path, &Default::default())?;
//!
//! let mut pager = Pager::open(&path, PagerOptions::with_quotas(1 << 20, 4 << 20))?;
//! let mut front = Front::new(&pager, Dependencies::Order)?;
//! pager.begin_frame();
//! front.update(&mut pager, |node| node.deviation, &UpdateLimits::with_tolerance(0.01));
//! assert!(front.num_triangles() < triangles.len());
//! assert!(pager.stats().resident_bytes <= 4 << 20);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod arena;
mod directory;
mod error;
mod loader;
mod options;
mod pager;
mod resident;
mod session;
mod stats;

pub use error::{Error, Problem};
pub use options::PagerOptions;
pub use pager::Pager;
pub use session::{Detail, FrameStats, Session, SessionOptions};
pub use stats::{Counters, PagerStats};
