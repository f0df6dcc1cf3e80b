//! From a mesh of any size to an `.xfm` file, in bounded memory.
//!
//! [`build_mesh`] is the whole line, from triangles on; [`build_from`] takes the half-edge collapses of whoever makes them. Its stages can be had one by one, too:
//!
//! 1. [`Linker`]: forwards. Of every vertex that is there it knows the top of its merge tree; with that each collapse gets its
//!    bounds, and it is known where its tree is cut into blocks and pages ([`mergetree::CutRule`]). An entry of a log says so.
//! 2. [`Linked::number`]: backwards. From the last collapse to the first all nodes get their places in the file, parents
//!    before children, and half-edges their names: the face of an adjacent half-edge is removed by a later collapse, or never.
//!    What has its place goes to the bucket of its page.
//! 3. [`Numbered::write`]: bucket by bucket the pages are put together, encoded and written.
//!
//! Vertices and faces have [names](NameBounds) that are used again, so that tables by name are as large as what is in memory
//! at once, and not as the mesh. Log and buckets lie in memory as far as they fit, and then in one scratch file, in which
//! buckets take the place of what was read of the log: 60 bytes per collapse in all.
//!
//! [`mergetree::Forest::from_records`] and [`xfm_format::write`] do the same in memory, and give the same file byte for
//! byte; a compact one up to its bounds, which are a little tighter here.
//!
//! A log may be [kept](Keep): then a run that was broken off after linking is gone on with by [`resume`], and one that was
//! broken off before by [`Linker::resume`] from the last [checkpoint](Feed::checkpoint). [`build_mesh`] does either.

mod assemble;
mod bucket;
mod build;
mod coarse;
mod error;
mod kept;
mod link;
mod log;
mod names;
mod number;
mod pace;
mod pack;
mod plan;
mod progress;
mod stream;
mod write;

#[cfg(test)]
extern crate self as xfm_build;
#[cfg(test)]
#[path = "../tests/common/mod.rs"]
mod common;
#[cfg(test)]
mod damage;

pub use build::{BuildOptions, BuildReport, Feed, build_from, go_on_from, resume};
pub use error::{CoarseProblem, Error, RecordProblem, StateProblem};
pub use kept::Keep;
pub use link::{LinkOptions, Linked, Linker};
pub use names::{CoarseFace, CoarseMesh, CoarseVertex, NameBounds};
pub use number::{NumberOptions, Numbered};
pub use progress::{Observer, Progress, Stage};
pub use stream::{
    Input, MemoryPlan, MeshError, MeshOptions, MeshProgress, MeshReport, Mode, build_mesh,
};
