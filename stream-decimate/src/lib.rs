//! Decimation of triangle streams of any length in a fixed buffer.
//!
//! [`decimate`] takes triangles from a source, in one pass, and gives fewer of them to a sink; what it needs in memory
//! depends on its buffer, not on the length of the stream. [`decimate_file`] may read a file again, to learn where its
//! boundaries are or to sort it; [`StreamDecimator`] has triangles pushed into it. [`decimate_greedy`] and
//! [`decimate_clustered`] are what it is compared with: as good as can be in core, and as fast.
//!
//! ```
//! use std::ops::ControlFlow;
//! use glam::vec3;
//! use mesh_io::{Error, IndexedMesh, MeshSource, Triangle, TriangleSink};
//! use stream_decimate::{DecimateOptions, Target, decimate};
//!
//! struct Soup(Vec<Triangle>);
//! impl TriangleSink for Soup {
//!     fn write(&mut self, triangles: &[Triangle]) -> Result<(), Error> {
//!         self.0.extend_from_slice(triangles);
//!         Ok(())
//!     }
//!     fn finish(self: Box<Self>) -> Result<(), Error> {
//!         Ok(())
//!     }
//! }
//!
//! // A wavy sheet of 5,000 triangles.
//! let point = |i: u32| vec3((i % 51) as f32, (i / 51) as f32, (0.2 * (i % 51) as f32).sin());
//! let cells = (0..50).flat_map(|y| (0..50).map(move |x| 51 * y + x));
//! let triangles = cells.flat_map(|v| [[v, v + 1, v + 52], [v, v + 52, v + 51]]).collect();
//! let mesh = IndexedMesh { positions: (0..51 * 51).map(point).collect(), triangles, ..Default::default() };
//!
//! let mut out = Soup(Vec::new());
//! let options = DecimateOptions::new(Target::Ratio(0.02));
//! let mut source = MeshSource::new(mesh, "sheet");
//! let report = decimate(&mut source, &mut out, &options, &mut |_| ControlFlow::Continue(()))?;
//! assert_eq!(report.to_string(), "100 of 5000 triangles");
//! assert_eq!(out.0.len(), 100);
//! # Ok::<(), stream_decimate::Error>(())
//! ```
//!
//! # How it works
//! READ puts triangles into the buffer, where they find their neighbours by the bits of their coordinates. DECIMATE
//! collapses edges until the buffer is half empty or at the resolution asked for, by quadrics and multiple choice. WRITE
//! takes out what is far from the triangles still to come. Neither the rim towards those (P_ab) nor the rim of what has
//! been written (P_bc) is changed, so that the output is one mesh without cracks; vertices are written at the minimum
//! of their quadrics.
//!
//! # Sources
//! Wu and Kobbelt, *A Stream Algorithm for the Decimation of Massive Meshes*, 2003.

mod cluster;
mod collapse;
mod decimator;
mod deviation;
mod distance;
mod error;
mod external;
mod finality;
mod greedy;
mod insert;
mod lookup;
#[cfg(test)]
mod messy;
mod missed;
mod names;
mod new_star;
mod options;
mod paint;
mod portion;
mod presort;
mod progress;
mod rate;
mod reorder;
mod report;
mod round;
mod run;
mod sealed;
mod star;
mod sweep;
mod write;

pub use cluster::decimate_clustered;
pub use collapse::{
    CollapseOptions, CollapseReport, CollapseState, Collapsed, CollapsedFace, CollapsedMesh,
    CollapsedVertex, Collapsing, ReadOrder, Recorder, check_input, collapse, collapse_file,
};
pub use decimator::StreamDecimator;
pub use error::Error;
pub use greedy::decimate_greedy;
pub use options::{DecimateOptions, OptionsError, Placement, Target};
pub use progress::{Observer, Progress, Stage};
pub use report::{DecimateReport, MissedTarget, Repairs};
pub use run::{decimate, decimate_file};
