//! How far a run is.

use std::ops::ControlFlow;

use crate::Error;

/// What a run is busy with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stage {
    /// Reading the input once to learn where each vertex is used for the last time.
    Counting,
    /// Sorting the input along its longest axis.
    Sorting,
    /// Reading once more what an earlier run has read.
    Skipping,
    /// Decimating.
    #[default]
    Decimating,
}

/// How far a run is, in triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// What the run is busy with; the counts below start anew with each stage.
    pub stage: Stage,
    /// Read so far.
    pub read: u64,
    /// To be read, where that is known or likely.
    pub expected: Option<u64>,
    /// Written so far.
    pub written: u64,
    /// In the buffer now.
    pub buffered: u64,
    /// What the buffer holds at most.
    pub capacity: u64,
    /// Share of the triangles that are left of those read and not yet written: the resolution level `R` of Wu and
    /// Kobbelt 2003, §4.1.
    pub resolution: f64,
}

/// Is told the progress several times a second; breaks the run off by returning `Break`.
pub type Observer<'a> = dyn FnMut(&Progress) -> ControlFlow<()> + 'a;

impl Progress {
    /// Tells the observer.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if it asks to stop.
    pub(crate) fn tell(&self, observer: &mut Observer<'_>) -> Result<(), Error> {
        match observer(self) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Error::Interrupted),
        }
    }
}
