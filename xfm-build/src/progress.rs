//! How far a build is.

use std::ops::ControlFlow;

use crate::Error;

/// A stage of a build.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Stage {
    /// Nodes get their places in the file.
    Number,
    /// Pages are encoded and written.
    Write,
}

/// How far a stage is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Progress {
    /// The stage.
    pub stage: Stage,
    /// Nodes done.
    pub done: u64,
    /// Nodes in all.
    pub total: u64,
}

/// Is told of progress, and may break off.
pub type Observer<'a> = dyn FnMut(Progress) -> ControlFlow<()> + 'a;

impl Stage {
    pub(crate) fn tell(
        self,
        done: u64,
        total: u64,
        observer: &mut Observer<'_>,
    ) -> Result<(), Error> {
        match observer(Progress { stage: self, done, total }) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Error::Interrupted),
        }
    }
}
