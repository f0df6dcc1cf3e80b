//! From a stream of half-edge collapses to an `.xfm` file, in bounded memory.

mod assemble;
mod bucket;
mod coarse;
mod error;
mod kept;
mod link;
mod log;
mod names;
mod number;
mod plan;
mod progress;
mod write;

pub use error::{CoarseProblem, Error, RecordProblem, StateProblem};
pub use kept::Keep;
pub use link::{LinkOptions, Linked, Linker};
pub use names::{CoarseFace, CoarseMesh, CoarseVertex, NameBounds};
pub use number::{NumberOptions, Numbered};
pub use progress::{Observer, Progress, Stage};
