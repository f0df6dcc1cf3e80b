//! Why a command failed, and how that becomes one line.

use std::io;
use std::path::PathBuf;

use halfedge::BuildError;
use mergetree::{CameraPathError, ForestError};

use crate::distance::DistanceError;
use crate::text;

/// Why a command failed. Each message names the file, the place in it where there is one, and the remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A mesh could not be read or written.
    #[error(transparent)]
    Mesh(#[from] mesh_io::Error),
    /// Standard input has no extension that would tell the format.
    #[error("standard input: cannot tell the format; say which it is with --from")]
    NoFormat,
    /// A terminal shows nothing of a binary mesh.
    #[error(
        "standard output: a terminal is no place for a mesh; redirect it, name a file, or ask for text with --to obj"
    )]
    NoOutputFormat,
    /// A `.xfm` file could not be written or read.
    #[error(transparent)]
    Format(#[from] xfm_format::Error),
    /// A file of another kind stands where a `.xfm` file is expected.
    #[error("{0}: not an .xfm file (wrong magic number at byte 0); make one with `xfm build {0} OUT.xfm`", file.display())]
    NotXfm {
        /// The file.
        file: PathBuf,
    },
    /// The folder of an output is not there.
    #[error("{}: its folder does not exist; create it first", file.display())]
    NoFolder {
        /// The output.
        file: PathBuf,
    },
    /// An output that has to be a file is something else.
    #[error("{}: cannot be written as a file; give it a name of its own, like model.xfm", file.display())]
    NotAFile {
        /// The output.
        file: PathBuf,
    },
    /// An output that has to be a mesh is a folder.
    #[error("{}: is a folder; give the mesh a name of its own, like small.ply", file.display())]
    IsAFolder {
        /// The output.
        file: PathBuf,
    },
    /// A file must not be written to.
    #[error("{}: cannot be written to: {source}; change its permissions, or choose another name", file.display())]
    LockedFile {
        /// The output.
        file: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The folder of an output takes no files.
    #[error(
        "{}: no file can be made in its folder: {source}; check the folder's permissions and free space, or choose another one",
        file.display()
    )]
    LockedFolder {
        /// The output.
        file: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A mesh could not be decimated.
    #[error("{name}: {source}")]
    Decimate {
        /// The input.
        name: String,
        /// What is wrong with it.
        source: stream_decimate::Error,
    },
    /// The folder for scratch files is not there.
    #[error("{}: there is no such folder; create it, or name another one with --scratch", folder.display())]
    NoScratchFolder {
        /// The folder.
        folder: PathBuf,
    },
    /// A scratch file could not be made or written.
    #[error("{}: scratch file: {source}; check its permissions and free space, or name another folder with --scratch", folder.display())]
    Scratch {
        /// The folder it is in.
        folder: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A file does not fit through the buffer, even sorted.
    #[error(
        "{name}: it does not fit through a buffer of {} triangles, even sorted: {} of them wait for their neighbours; \
         give a larger one with --buffer", text::count(*buffer as u64), text::count(*waiting)
    )]
    BufferTooSmall {
        /// The input.
        name: String,
        /// Triangles of the buffer that wait for neighbours.
        waiting: u64,
        /// Triangles the buffer holds.
        buffer: usize,
    },
    /// The system has no room for the buffer.
    #[error(
        "there is no memory for a buffer of {} triangles; ask for a smaller one with --buffer",
        text::count(*triangles as u64)
    )]
    BufferTooLarge {
        /// The triangles it was to hold.
        triangles: usize,
    },
    /// There is not even memory for the least buffer.
    #[error(
        "{}: building takes {} at least, {} are allowed; raise --memory",
        file.display(), text::size(*needed), text::size(*memory)
    )]
    LittleMemory {
        /// The input.
        file: PathBuf,
        /// What is needed for any mesh, in bytes.
        needed: u64,
        /// What is allowed, in bytes.
        memory: u64,
    },
    /// How large a share of a pipe's bounding box is cannot be known.
    #[error(
        "{name}: the bounding box of a pipe is not known beforehand; give --position-error in model units, like 0.05u, or build from a file"
    )]
    ShareOfPipe {
        /// The input.
        name: String,
    },
    /// The input needs more memory than it may have.
    #[error(
        "{}: building {} triangles takes up to {}, {} are allowed; raise --memory", file.display(),
        text::count(*triangles), text::size(*needed), text::size(*memory)
    )]
    MemoryTooSmall {
        /// The input.
        file: PathBuf,
        /// Its triangles.
        triangles: u64,
        /// What they take at most, in bytes.
        needed: u64,
        /// What is allowed, in bytes.
        memory: u64,
    },
    /// There is not enough room on a disk.
    #[error(
        "{}: about {} are needed there and {} are free; free some space, or name another folder with {remedy}",
        folder.display(), text::size(*needed), text::size(*free)
    )]
    NoRoom {
        /// The folder.
        folder: PathBuf,
        /// Bytes that are needed.
        needed: u64,
        /// Bytes that are free.
        free: u64,
        /// What names another folder.
        remedy: &'static str,
    },
    /// A mesh does not fit through the memory in the order it comes.
    #[error(
        "{name}: it does not fit through {}, in no order: {} of {} triangles wait for their neighbours; raise --memory",
        text::size(*memory), text::count(*waiting), text::count(*buffer as u64)
    )]
    MemoryTooSmallForOrder {
        /// The input.
        name: String,
        /// Triangles of the buffer that wait for neighbours.
        waiting: u64,
        /// Triangles the buffer holds.
        buffer: usize,
        /// What is allowed, in bytes.
        memory: u64,
    },
    /// A mesh could not be made into a file.
    #[error(transparent)]
    BuildMesh(xfm_build::MeshError),
    /// What an earlier run has left cannot be gone on with.
    #[error("{source}: leave out --resume")]
    Resume {
        /// What is wrong with it.
        source: xfm_build::Error,
    },
    /// The grid of a compact file does not suit the mesh.
    #[error("{}: {source}; give another --position-error, or build it exact", file.display())]
    Grid {
        /// The input.
        file: PathBuf,
        /// What does not suit.
        source: xfm_build::Error,
    },
    /// A stream could not be built into a file.
    #[error(transparent)]
    Build(#[from] xfm_build::Error),
    /// A scratch file could not be made, written or read.
    #[error(transparent)]
    ScratchFile(#[from] scratch::Error),
    /// After the repair no triangle is left.
    #[error("{}: there is no triangle with three different corners; check that it is the file you meant", file.display())]
    NothingToBuild {
        /// The input.
        file: PathBuf,
    },
    /// The triangles name vertices that are not there.
    #[error("{}: {source}; export the mesh again", file.display())]
    Repair {
        /// The input.
        file: PathBuf,
        /// What is wrong.
        source: BuildError,
    },
    /// The forest could not be built.
    #[error("{}: {source}; split the mesh", file.display())]
    Forest {
        /// The input.
        file: PathBuf,
        /// What is wrong.
        source: ForestError,
    },
    /// The coarsest mesh of a file is not a manifold.
    #[error("{}: coarsest mesh: {source}; build the file again", file.display())]
    Base {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        source: BuildError,
    },
    /// Nodes of a file contradict each other.
    #[error("{}: {nodes} nodes do not fit the mesh around them; find them with `xfm verify` and build the file again", file.display())]
    DamagedNodes {
        /// The file.
        file: PathBuf,
        /// How many.
        nodes: u64,
    },
    /// A `.xfm` file could not be paged.
    #[error(transparent)]
    Pager(#[from] xfm_pager::Error),
    /// Something that must hold in every frame does not.
    #[error("{}: frame {frame} of {route}: {what}; this is an error of xfm, please report it with the file", file.display())]
    Invariant {
        /// The file.
        file: PathBuf,
        /// The frame, from 0.
        frame: usize,
        /// What the camera was doing: the path, or seed and jump.
        route: String,
        /// What does not hold.
        what: String,
    },
    /// A camera path could not be read.
    #[error("{}: cannot read the camera path: {source}; give `orbit` or a text file", file.display())]
    ReadPath {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A camera path makes no sense.
    #[error("{}: {source}; write one pose per line: eye x y z, at x y z", file.display())]
    CameraPath {
        /// The file.
        file: PathBuf,
        /// What is wrong, and where.
        source: CameraPathError,
    },
    /// A file has been found to be damaged.
    #[error(
        "{}: {}{first}; copy or build the file again", file.display(),
        if *errors > 1 { format!("{} errors, the first: ", text::count(*errors)) } else { String::new() }
    )]
    VerifyFailed {
        /// The file.
        file: PathBuf,
        /// How many errors.
        errors: u64,
        /// The first of them.
        first: String,
    },
    /// Meshes cannot be compared.
    #[error("{name}: {source}")]
    Distance {
        /// The file, or both files.
        name: String,
        /// What is wrong with it.
        source: DistanceError,
    },
    /// The operating system did not give the threads asked for.
    #[error("cannot start the worker threads: {source}; ask for fewer with --threads")]
    Threads {
        /// What the system said.
        source: rayon::ThreadPoolBuildError,
    },
    /// The report could not be written.
    #[error("standard output: cannot write the report: {source}; check where it is redirected to")]
    Report {
        /// What the system said.
        source: io::Error,
    },
    /// The user pressed Ctrl-C, or the process was asked to terminate.
    #[error("interrupted; no output was written")]
    Interrupted,
    /// The same, in a build that can be gone on with.
    #[error("interrupted; no output was written; the same command with --resume goes on from what is kept in {}", folder.display())]
    InterruptedKept {
        /// Where it is kept.
        folder: PathBuf,
    },
}

impl Error {
    /// The process's exit code: 130 for an interruption (128 + the number of the signal, as shells have it), else 1.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Interrupted | Self::InterruptedKept { .. } => 130,
            _ => 1,
        }
    }
}

/// An error with all its sources on one line; a source that the line tells already is not told twice.
///
/// ```
/// let error = std::io::Error::other("first\nsecond");
/// assert_eq!(xfm::one_line(&error), "first second");
/// ```
pub fn one_line(error: &dyn std::error::Error) -> String {
    let flat = |message: String| message.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut line = flat(error.to_string());
    let mut next = error.source();
    while let Some(source) = next {
        let message = flat(source.to_string());
        if !line.contains(&message) {
            line = format!("{line}: {message}");
        }
        next = source.source();
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("{message}")]
    struct Link {
        message: &'static str,
        source: Option<Box<Link>>,
    }

    fn link(message: &'static str, source: Option<Link>) -> Link {
        Link { message, source: source.map(Box::new) }
    }

    #[test]
    fn sources_are_joined_once_each() {
        let chain = link("a.xfm: cannot read", Some(link("page 3", Some(link("bad sum", None)))));
        assert_eq!(one_line(&chain), "a.xfm: cannot read: page 3: bad sum");
        let told = link("page 3: bad sum", Some(link("bad sum", None)));
        assert_eq!(one_line(&told), "page 3: bad sum");
    }

    #[test]
    fn an_interruption_has_its_own_exit_code() {
        assert_eq!(Error::Interrupted.exit_code(), 130);
        let report = Error::Report { source: io::Error::other("full") };
        assert_eq!(report.exit_code(), 1);
    }
}
