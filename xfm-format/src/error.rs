//! What can go wrong, and where.

use std::fmt;
use std::io;
use std::path::PathBuf;

/// A place in a `.xfm` file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Place {
    /// The file as a whole.
    File,
    /// The header.
    Header,
    /// The coarsest mesh.
    Base,
    /// The root list.
    Roots,
    /// The page index.
    Index,
    /// A page, by its number.
    Page(u64),
    /// A block, by its number.
    Block(u64),
    /// A node, by its id in the file's numbering.
    Node(u64),
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File => f.write_str("file"),
            Self::Header => f.write_str("header"),
            Self::Base => f.write_str("coarsest mesh"),
            Self::Roots => f.write_str("root list"),
            Self::Index => f.write_str("page index"),
            Self::Page(page) => write!(f, "page {page}"),
            Self::Block(block) => write!(f, "block {block}"),
            Self::Node(node) => write!(f, "node {node}"),
        }
    }
}

/// Why a file could not be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The operating system, or the storage behind the file, refused.
    #[error("{}: cannot {action}: {source}; check the path, its permissions and the free space", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// What was tried.
        action: &'static str,
        /// The refusal.
        source: io::Error,
    },
    /// The file does not begin with the magic number.
    #[error("{}: not an .xfm file (wrong magic number at byte 0)", file.display())]
    NotXfm {
        /// The file.
        file: PathBuf,
    },
    /// The file has a version that this reader does not know.
    #[error("{}: format version {found} is not supported, only {supported}; {}", file.display(), if found < supported { "build the file again" } else { "use a newer program" })]
    UnsupportedVersion {
        /// The file.
        file: PathBuf,
        /// Its version.
        found: u32,
        /// The version known.
        supported: u32,
    },
    /// The file needs features that this reader does not know.
    #[error("{}: needs unknown features {flags:#x}; use a newer program", file.display())]
    UnsupportedFeatures {
        /// The file.
        file: PathBuf,
        /// The unknown ones among its feature flags.
        flags: u64,
    },
    /// The file has an encoding that this reader does not know.
    #[error("{}: encoding {found} is not supported; use a newer program", file.display())]
    UnsupportedEncoding {
        /// The file.
        file: PathBuf,
        /// Number of the encoding.
        found: u8,
    },
    /// The file ends too early.
    #[error("{}: {place} needs {needed} bytes, the file ends after {found}; copy it again", file.display())]
    Truncated {
        /// The file.
        file: PathBuf,
        /// What is cut.
        place: Place,
        /// Length the file must have.
        needed: u64,
        /// Length it has.
        found: u64,
    },
    /// The file goes on after its end.
    #[error("{}: is {found} bytes long, should be {expected}; copy it again", file.display())]
    TrailingBytes {
        /// The file.
        file: PathBuf,
        /// Length it must have.
        expected: u64,
        /// Length it has.
        found: u64,
    },
    /// A part of the file is not what was written.
    #[error("{}: {place} is damaged (checksum {found:08x}, should be {expected:08x}); copy or build the file again", file.display())]
    Checksum {
        /// The file.
        file: PathBuf,
        /// The part.
        place: Place,
        /// Checksum noted in the file.
        expected: u32,
        /// Checksum of what is there.
        found: u32,
    },
    /// A part of the file has its checksum and makes no sense all the same.
    #[error("{}: {place}: {message}; build the file again", file.display())]
    Invalid {
        /// The file.
        file: PathBuf,
        /// The part.
        place: Place,
        /// What is wrong.
        message: String,
    },
    /// The file is sound, but names more half-edges than ids of 32 bits can.
    #[error("{}: {half_edges} half-edge names are more than this program can hold ({max})", file.display())]
    TooLarge {
        /// The file.
        file: PathBuf,
        /// Number of half-edge names.
        half_edges: u64,
        /// Largest number possible.
        max: u64,
    },
    /// The forest to be written is not one.
    #[error("{}: cannot write this forest: node {node}: {message}", file.display())]
    InvalidForest {
        /// The file that was to be written.
        file: PathBuf,
        /// The node: its index in the forest, or its id in the file's numbering where it came with one.
        node: usize,
        /// What is wrong with it.
        message: &'static str,
    },
    /// The coarsest mesh of the forest to be written is not one.
    #[error("{}: cannot write this coarsest mesh: {message}", file.display())]
    InvalidBase {
        /// The file that was to be written.
        file: PathBuf,
        /// What is wrong with it.
        message: String,
    },
    /// What was written is not what was announced.
    #[error("{}: {written} {what} written, of {stated} that were announced", file.display())]
    WrongTotals {
        /// The file that was to be written.
        file: PathBuf,
        /// What is counted.
        what: &'static str,
        /// How many were announced.
        stated: u64,
        /// How many came.
        written: u64,
    },
    /// The error allowed for positions is none.
    #[error("the error allowed for positions {what}")]
    PositionError {
        /// Why.
        what: &'static str,
    },
    /// An option has a value outside its range.
    #[error("{name} is {value}, must be {min} to {max}")]
    Option {
        /// Name of the option.
        name: &'static str,
        /// Its value.
        value: u64,
        /// Least value.
        min: u64,
        /// Largest value.
        max: u64,
    },
}

/// Something wrong inside a part of the file, before it is known which file that is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Defect {
    pub place: Place,
    pub message: String,
}

impl Defect {
    pub fn new(place: Place, message: impl Into<String>) -> Self {
        Self { place, message: message.into() }
    }

    pub fn in_file(self, file: &std::path::Path) -> Error {
        Error::Invalid { file: file.to_owned(), place: self.place, message: self.message }
    }
}
