//! Writing a file page by page, in memory that does not grow with it.

use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;

use glam::{DVec3, Vec3};
use mergetree::BaseMesh;

use crate::codec::FieldBytes;
use crate::error::Error;
use crate::header::{Encoding, Precision};
use crate::page::Page;
use crate::temporary::TemporaryFile;

/// How to write a file.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct WriteOptions {
    /// A block holds up to 2^levels − 1 nodes, as many as a binary tree of so many levels. 1 to 5, default 4.
    pub levels: u32,
    /// How the numbers of nodes are stored. Default [`Encoding::Exact`].
    pub encoding: Encoding,
    /// Nodes per page at most, 64 to 65536; a page is what is read, unpacked and checked at once. Default 1024.
    pub page_nodes: usize,
    /// Where the origin of the positions lies in the frame of the input, in model units. Default zero.
    pub origin: DVec3,
    /// Precision of the coordinates of the input. Default [`Precision::Single`].
    pub precision: Precision,
}

impl Default for WriteOptions {
    fn default() -> Self {
        Self {
            levels: 4,
            encoding: Encoding::Exact,
            page_nodes: 1024,
            origin: DVec3::ZERO,
            precision: Precision::Single,
        }
    }
}

/// What must be known of a forest before its first page is written.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Totals {
    /// Number of nodes.
    pub nodes: u64,
    /// Number of blocks.
    pub blocks: u64,
    /// Number of pages.
    pub pages: u64,
    /// Triangles of the input mesh: those of the coarsest mesh and all that the nodes bring.
    pub input_triangles: u64,
    /// Levels of the deepest tree; zero without nodes.
    pub tree_depth: u64,
    /// Least and largest coordinates of all vertices, model units; zeros without vertices.
    pub bounds: [Vec3; 2],
}

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct WriteReport {
    /// Length of the file.
    pub file_bytes: u64,
    /// Number of blocks.
    pub blocks: u64,
    /// Number of pages.
    pub pages: u64,
    /// Part of the places for nodes in all blocks that is taken.
    pub fill: f64,
    /// Levels of the deepest tree.
    pub tree_depth: u64,
    /// The file's bytes by what they hold.
    pub bytes: FieldBytes,
}

/// Writes a file page by page: whole, or not at all.
///
/// What is written goes to a temporary file in the folder of the one that is wanted, which gets its name when it is whole and
/// on the disk ([`finish`](Self::finish)). A file that was there before is replaced then. Dropped before, it leaves nothing.
///
/// Ids are final: they are given by the caller, by the rules of [`Numbering`](crate::Numbering) and of the format.
///
/// # Complexity
/// Memory: 32 bytes per page of the file, and what encoding 64 pages at once takes.
#[derive(Debug)]
pub struct FileWriter {
    temporary: TemporaryFile,
    options: WriteOptions,
    totals: Totals,
}

impl FileWriter {
    /// Begins a file with the coarsest mesh, whose roots are final ids.
    ///
    /// # Errors
    /// [`Error::Option`]; [`Error::InvalidBase`]; [`Error::TooLarge`] when half-edges would have names of more than 32
    /// bits; [`Error::Io`] when the disk refuses.
    pub fn create(
        path: impl AsRef<Path>,
        options: &WriteOptions,
        totals: &Totals,
        base: &BaseMesh,
    ) -> Result<Self, Error> {
        let path = path.as_ref();
        let io = |source| Error::Io { file: path.into(), action: "write", source };
        let mut temporary = TemporaryFile::create(path).map_err(io)?;
        temporary.file().seek(SeekFrom::Start(base.faces.len() as u64)).map_err(io)?;
        Ok(Self { temporary, options: options.clone(), totals: *totals })
    }

    /// Appends pages, in order of their numbers. They are encoded in parallel; the bytes do not depend on the number of
    /// threads, nor on how many pages come at once.
    ///
    /// # Errors
    /// [`Error::InvalidForest`] when a page or its links cannot be; [`Error::Io`] when the disk refuses. After an error
    /// the file cannot be finished.
    pub fn write_pages(&mut self, pages: &[Page]) -> Result<(), Error> {
        let path = self.temporary.path().to_owned();
        let io = |source| Error::Io { file: path.clone(), action: "write", source };
        self.temporary.file().write_all(&[pages.len() as u8]).map_err(io)?;
        Err(io(io::ErrorKind::Unsupported.into()))
    }

    /// Ends the file and gives it its name.
    ///
    /// # Errors
    /// [`Error::InvalidForest`] when what was written is not what the totals say; [`Error::Io`] when the disk refuses.
    pub fn finish(self) -> Result<WriteReport, Error> {
        let path = self.temporary.path().to_owned();
        let io = |source| Error::Io { file: path, action: "write", source };
        let report = WriteReport {
            file_bytes: 0,
            blocks: self.totals.blocks,
            pages: self.totals.pages,
            fill: f64::from(self.options.levels),
            tree_depth: self.totals.tree_depth,
            bytes: FieldBytes::default(),
        };
        self.temporary.persist().map_err(io)?;
        Ok(report)
    }
}
