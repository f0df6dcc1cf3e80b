//! What can go wrong, and where in the file it did.

use std::fmt;
use std::io;

/// Where in a file something is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole, or a named part of it that the message tells.
    File,
    /// A line of text, counted from one.
    Line(u64),
    /// An offset in bytes from the start of the (unpacked) file.
    Byte(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File => Ok(()),
            Self::Line(line) => write!(f, ", line {line}"),
            Self::Byte(byte) => write!(f, ", byte {byte}"),
        }
    }
}

/// Why a mesh could not be read or written.
///
/// Each message names the file, the place in it where there is one, and the remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system refused.
    #[error(
        "{name}: cannot {action}: {source}; check the path, its permissions and the free space"
    )]
    Io {
        /// The file or stream.
        name: String,
        /// What was tried, as a verb.
        action: &'static str,
        /// The system's answer.
        source: io::Error,
    },
    /// Neither the name nor the content tells the format.
    #[error(
        "{name}: cannot tell the format; name the file .stl, .ply, .obj, .gltf or .glb, or say which format it is"
    )]
    UnknownFormat {
        /// The file or stream.
        name: String,
    },
    /// The format or packing was left out of this build.
    #[error("{name}: this build leaves out {what}; build mesh-io with the feature `{feature}`")]
    FeatureDisabled {
        /// The file or stream.
        name: String,
        /// The format or packing.
        what: &'static str,
        /// The cargo feature that brings it back.
        feature: &'static str,
    },
    /// There is not a single byte.
    #[error("{name}: the file is empty; write or copy it again")]
    Empty {
        /// The file or stream.
        name: String,
    },
    /// The file ends too early.
    #[error("{name}{place}: the file ends before {missing}; copy or export it again")]
    Truncated {
        /// The file or stream.
        name: String,
        /// Where it ends.
        place: Place,
        /// What should have followed.
        missing: String,
    },
    /// The content breaks the rules of its format.
    #[error("{name}{place}: {problem}; {remedy}")]
    Malformed {
        /// The file or stream.
        name: String,
        /// Where.
        place: Place,
        /// What is there.
        problem: String,
        /// What to do about it.
        remedy: &'static str,
    },
    /// A face names a vertex that does not exist.
    #[error(
        "{name}{place}: vertex index {index} is out of range, there are {num_vertices} vertices; export the mesh again or remove that face"
    )]
    IndexOutOfRange {
        /// The file or stream.
        name: String,
        /// Where.
        place: Place,
        /// The index as it stands in the file (OBJ counts from one, PLY and glTF from zero).
        index: i64,
        /// How many vertices there are.
        num_vertices: u64,
    },
    /// The mesh has more of something than the format, or this crate, can hold.
    #[error(
        "{name}: too many {what}, the limit is {limit}; split the mesh or choose another format"
    )]
    TooLarge {
        /// The file or stream.
        name: String,
        /// What there is too much of.
        what: &'static str,
        /// The most there can be.
        limit: u64,
    },
}

impl Error {
    #[cfg_attr(
        not(any(feature = "stl", feature = "ply", feature = "obj", feature = "gltf")),
        allow(dead_code)
    )]
    pub(crate) fn io(name: &str, action: &'static str, source: io::Error) -> Self {
        Self::Io { name: name.to_owned(), action, source }
    }
}
