//! What can go wrong.

use std::path::PathBuf;

/// Why a file could not be built.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A scratch file could not be made, written or read.
    #[error(transparent)]
    Scratch(#[from] scratch::Error),
    /// The file could not be written.
    #[error(transparent)]
    Format(#[from] xfm_format::Error),
    /// There are more collapses than nodes can have ids.
    #[error(
        "{nodes} collapses need more than the {max} blocks that 32-bit half-edge names allow; split the mesh"
    )]
    TooLarge {
        /// Collapses so far.
        nodes: u64,
        /// Blocks that there can be.
        max: u64,
    },
    /// Names are to be larger than they can be.
    #[error("names of vertices up to {vertices} and of faces up to {faces}; take a smaller buffer")]
    Names {
        /// The bound of the names of vertices.
        vertices: u32,
        /// The bound of the names of faces.
        faces: u32,
    },
    /// A collapse contradicts what comes after it, or is none.
    #[error("collapse {order}: {problem}")]
    Record {
        /// Its place in the sequence.
        order: u64,
        /// What is wrong with it.
        problem: RecordProblem,
    },
    /// The coarsest mesh contradicts itself or the collapses.
    #[error("coarsest mesh: {0}")]
    Coarse(CoarseProblem),
    /// Less memory is allowed than the tables take.
    #[error("linking takes {needed} bytes of memory, {allowed} are allowed; allow more")]
    Memory {
        /// What it takes.
        needed: u64,
        /// What is allowed.
        allowed: u64,
    },
    /// What was written to a scratch file is not what is read from it.
    #[error("the log of collapses contradicts itself at collapse {order}: {what}; begin again")]
    Damaged {
        /// A collapse near the place.
        order: u64,
        /// What is wrong.
        what: &'static str,
    },
    /// What an earlier run left to go on from cannot be used.
    #[error("{}: {problem}", file.display())]
    State {
        /// The file that says how far that run was.
        file: PathBuf,
        /// What is wrong with it.
        problem: StateProblem,
    },
    /// A thread could not be started.
    #[error("a thread could not be started: {0}")]
    Thread(std::io::Error),
    /// The linker takes no more collapses, because it has failed before.
    #[error("the collapses are not linked any more")]
    Stopped,
    /// The observer asked to stop.
    #[error("interrupted")]
    Interrupted,
}

/// What is wrong with a collapse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RecordProblem {
    /// A vertex or face has a name beyond what was agreed.
    #[error("a name that is too large")]
    Name,
    /// The vertex it removes is the one it keeps.
    #[error("it removes the vertex that it keeps")]
    Same,
    /// Position or bounds are not finite numbers.
    #[error("a position or bound that is not a finite number")]
    NotFinite,
    /// The grid of the positions does not reach so far.
    #[error("a position too far from the origin for the error allowed")]
    TooFar,
    /// It names a half-edge whose face is neither removed later nor in the coarsest mesh.
    #[error(
        "half-edge {0} belongs to a face that is neither removed later nor in the coarsest mesh"
    )]
    LostHalfEdge(u32),
    /// It removes a second face and has no half-edge `y`.
    #[error("a second face without the half-edge y, or the other way round")]
    SecondFace,
    /// The vertex has a colour and others have none, or the other way round.
    #[error("a colour where vertices have none, or none where they have some")]
    Colour,
}

/// What is wrong with a coarsest mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CoarseProblem {
    /// A vertex or face has a name beyond what was agreed.
    #[error("a vertex or face with a name that is too large")]
    Name,
    /// Two vertices have the same name.
    #[error("vertex {0} is there twice")]
    VertexTwice(u32),
    /// Two faces have the same name.
    #[error("face {0} is there twice")]
    FaceTwice(u32),
    /// A corner of a face is not among the vertices.
    #[error("face {0} has a corner that is not there")]
    NoCorner(u32),
    /// A vertex that others were collapsed into is missing.
    #[error("vertex {0} is missing, and others were collapsed into it")]
    NoVertex(u32),
    /// The grid of the positions does not reach a vertex.
    #[error("a vertex is too far from the origin for the error allowed")]
    TooFar,
    /// There are more faces than half-edges can have names.
    #[error("too many faces")]
    TooLarge,
    /// There are more or fewer colours than there should be.
    #[error("colours for more or fewer vertices than there are")]
    Colours,
}

/// Why a run cannot go on where an earlier one ended.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StateProblem {
    /// The file cannot be read.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// It is not such a file, or a damaged one, or from another version of the program: this cannot be right.
    #[error("is damaged or from another version ({0} cannot be right); begin again without it")]
    Damaged(&'static str),
    /// It is about another input or other options.
    #[error("belongs to another input or to other options; begin again without it")]
    Other,
}

impl From<scratch::CheckpointError> for StateProblem {
    fn from(error: scratch::CheckpointError) -> Self {
        use scratch::CheckpointError;
        match error {
            CheckpointError::Io(error) => Self::Io(error),
            CheckpointError::Damaged(what) => Self::Damaged(what),
            _ => Self::Other,
        }
    }
}
