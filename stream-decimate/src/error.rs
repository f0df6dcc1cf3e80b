//! What can go wrong.

use std::io;

use crate::OptionsError;

/// Why a mesh could not be decimated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An option is out of its range.
    #[error(transparent)]
    Options(#[from] OptionsError),
    /// The input could not be read, or the output not be written.
    #[error(transparent)]
    Mesh(#[from] mesh_io::Error),
    /// The triangles come in an order that no buffer of this size can follow.
    #[error(
        "the stream is not sorted well enough for a buffer of {buffer} triangles: after {read} triangles, {waiting} \
         wait for neighbours that have not come; give the input as a file, so that it can be sorted, or a larger \
         buffer"
    )]
    Unsorted {
        /// Triangles read so far.
        read: u64,
        /// Triangles of the buffer that wait for a neighbour.
        waiting: u64,
        /// Triangles the buffer holds.
        buffer: usize,
    },
    /// A number of triangles was asked for that the buffer cannot keep back until the end of a stream of unknown length.
    #[error(
        "{target} triangles are asked for of a stream of unknown length, more than a buffer of {buffer} triangles can \
         keep until its end: give a ratio, a buffer of {needed} triangles, or the input as a file"
    )]
    UnknownLength {
        /// Triangles asked for.
        target: u64,
        /// Triangles the buffer holds.
        buffer: usize,
        /// Triangles the buffer would have to hold.
        needed: u64,
    },
    /// A scratch file could not be made, written or read.
    #[error(
        "scratch file in {folder}: {source}; check its permissions and free space, or choose another folder"
    )]
    Scratch {
        /// The folder it is in.
        folder: String,
        /// What the operating system says.
        source: io::Error,
    },
    /// A checkpoint of an earlier run cannot be gone on from.
    #[error("the checkpoint: {0}")]
    Checkpoint(#[from] scratch::CheckpointError),
    /// What comes is not what an earlier run has read.
    #[error("the first {read} triangles are not those that an earlier run has read")]
    OtherInput {
        /// Triangles that it has read.
        read: u64,
    },
    /// The threads could not be started.
    #[error("the threads for decimating could not be started: {0}")]
    Threads(rayon::ThreadPoolBuildError),
    /// The observer asked to stop.
    #[error("interrupted")]
    Interrupted,
}

impl From<scratch::Error> for Error {
    fn from(error: scratch::Error) -> Self {
        Self::Scratch { folder: error.folder.display().to_string(), source: error.source }
    }
}
