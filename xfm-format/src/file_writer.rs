//! Writing a file page by page, in memory that does not grow with it.

use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use glam::{DVec3, Vec3};
use mergetree::BaseMesh;
use rayon::prelude::*;

use crate::codec::{FieldBytes, PageContext, PageDefect, PageEncoder};
use crate::error::Error;
use crate::header::{
    Attribute, Encoding, Header, HeaderProblem, Precision, Section, VERSION, standard_attributes,
};
use crate::page::Page;
use crate::rounding::Rounding;
use crate::sections::{IndexEntry, Tag, encode_base, encode_index, encode_roots};
use crate::temporary::TemporaryFile;

/// Pages that are encoded at once, in parallel.
pub(crate) const BATCH_PAGES: usize = 64;

/// Larger errors make no grid.
const MAX_ERROR: f64 = 1e29;

/// How to write a file.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct WriteOptions {
    /// A block holds up to 2^levels − 1 nodes, as many as a binary tree of so many levels. 1 to 5, default 4.
    pub levels: u32,
    /// How the numbers of nodes are stored. Default [`Encoding::Exact`].
    pub encoding: Encoding,
    /// How far positions may move where the encoding is [`Encoding::Compact`]. Default 2·10⁻⁴ of the diagonal of the bounding
    /// box.
    pub position_error: PositionError,
    /// Nodes per page at most, 64 to 65536; a page is what is read, unpacked and checked at once. By default 600 for
    /// [`Encoding::Exact`], of which a page is unpacked within a tenth of a millisecond; 1024 for the other, which is smaller for
    /// it.
    pub page_nodes: Option<usize>,
    /// Nodes at most of a connected piece of a tree that lies in one page as a whole, up to those of a page; a page holds pieces
    /// that hang under the same page. Small ones have a view touch few pages: of a piece that is touched all of its page comes.
    /// Large ones make the encoding [`Encoding::Compact`] smaller. By default blocks for [`Encoding::Exact`], 200 for the other.
    pub piece_nodes: Option<usize>,
    /// Where the origin of the positions lies in the frame of the input, in model units. Default zero.
    pub origin: DVec3,
    /// Precision of the coordinates of the input. Default [`Precision::Single`].
    pub precision: Precision,
}

/// A bound for the distance between a vertex and where it comes to lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PositionError {
    /// A share of the diagonal of the bounding box. Whoever does not know the box beforehand cannot take it.
    OfDiagonal(f64),
    /// A distance in model units.
    Units(f64),
}

impl Default for PositionError {
    fn default() -> Self {
        Self::OfDiagonal(2e-4)
    }
}

impl PositionError {
    /// The same bound in model units for what has this bounding box.
    pub fn in_units(self, bounds: [Vec3; 2]) -> Self {
        let Self::OfDiagonal(share) = self else { return self };
        let [min, max] = bounds.map(Vec3::as_dvec3);
        // What is all in one point has a grid, too.
        let diagonal = min.distance(max);
        Self::Units(if diagonal > 0.0 { share * diagonal } else { share })
    }
}

impl Default for WriteOptions {
    fn default() -> Self {
        Self {
            levels: 4,
            encoding: Encoding::Exact,
            position_error: PositionError::default(),
            page_nodes: None,
            piece_nodes: None,
            origin: DVec3::ZERO,
            precision: Precision::Single,
        }
    }
}

impl WriteOptions {
    /// Checks that all options are in their ranges.
    ///
    /// # Errors
    /// [`Error::Option`] for the first one that is not.
    pub fn check(&self) -> Result<(), Error> {
        for (name, value, min, max) in [
            ("levels per block", u64::from(self.levels), 1, 5),
            ("nodes per page", self.page_nodes() as u64, 64, 65536),
            ("nodes per piece", self.piece_nodes() as u64, 1, self.page_nodes() as u64),
        ] {
            if !(min..=max).contains(&value) {
                return Err(Error::Option { name, value, min, max });
            }
        }
        let (PositionError::OfDiagonal(error) | PositionError::Units(error)) = self.position_error;
        if !(error > 0.0 && error < MAX_ERROR) {
            return Err(Error::PositionError {
                what: "is not a number above zero and below 10^29",
            });
        }
        Ok(())
    }

    /// Nodes of a page at most: those asked for, or the default.
    pub fn page_nodes(&self) -> usize {
        self.page_nodes.unwrap_or(match self.encoding {
            Encoding::Exact => 600,
            Encoding::Compact => 1024,
        })
    }

    /// Nodes of a piece at most: those asked for, or the default.
    pub fn piece_nodes(&self) -> usize {
        let default = match self.encoding {
            Encoding::Exact => (1 << self.levels.min(5)) - 1,
            Encoding::Compact => 200,
        };
        self.piece_nodes.unwrap_or(default.min(self.page_nodes()))
    }

    /// What nodes are to be rounded to before they are written.
    ///
    /// # Errors
    /// [`Error::Option`] and [`Error::PositionError`], the latter also where the error is given as a share of a bounding box;
    /// see [`PositionError::in_units`].
    pub fn rounding(&self) -> Result<Rounding, Error> {
        self.check()?;
        match (self.encoding, self.position_error) {
            (Encoding::Exact, _) => Ok(Rounding::EXACT),
            (Encoding::Compact, PositionError::Units(error)) => Ok(Rounding::with_error(error)),
            (Encoding::Compact, PositionError::OfDiagonal(_)) => {
                Err(Error::PositionError { what: "has to be in model units here" })
            }
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
    /// Least and largest coordinates of all vertices, in model units relative to the origin; zeros without vertices.
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
/// Ids are final: they are given by the caller, by the rules of [`Numbering`](crate::Numbering) and of the format. What one
/// page shows of it is checked; for what spans pages there is [`verify`](crate::verify).
///
/// # Complexity
/// Memory: 32 bytes per page of the file, and what encoding 64 pages at once takes.
///
/// # Examples
/// ```
/// use glam::Vec3;
/// use mergetree::{BaseMesh, BaseVertex, Node, OctNormal};
/// use xfm_format::{BlockId, FileWriter, Numbering, Page, Totals, WriteOptions, XfmFile};
///
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("triangle.xfm");
/// // A triangle, and the collapse that took another one from its edge.
/// let options = WriteOptions::default();
/// let root = Numbering::new(options.levels).node(BlockId::new(0), 0);
/// let vertex = |position, root| BaseVertex { position, normal: OctNormal::new(Vec3::Z), root };
/// let base = BaseMesh {
///     vertices: vec![vertex(Vec3::ZERO, Some(root)), vertex(Vec3::X, None), vertex(Vec3::Y, None)],
///     faces: vec![[0, 1, 2]],
///     colours: Vec::new(),
/// };
/// let node = Node { position: Vec3::NEG_Y, adjacent: [None, None, None, None], ..Node::BLANK };
/// let totals = Totals {
///     nodes: 1,
///     blocks: 1,
///     pages: 1,
///     input_triangles: 2,
///     tree_depth: 1,
///     bounds: [Vec3::NEG_Y, Vec3::ONE.with_z(0.0)],
/// };
/// let mut writer = FileWriter::create(&path, &options, &totals, &base)?;
/// let mut page = Page::starting_at(BlockId::new(0));
/// page.push_block(&[node]);
/// writer.write_pages(&[page])?;
/// assert_eq!(writer.finish()?.pages, 1);
/// assert_eq!(XfmFile::open(&path)?.read_page(0)?.nodes(), [node]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct FileWriter {
    temporary: TemporaryFile,
    /// Without the places and checksums of what is not written yet.
    header: Header,
    context: PageContext,
    encoders: EncoderPool,
    entries: Vec<IndexEntry>,
    /// Where the next page goes.
    at: u64,
    bytes: FieldBytes,
    /// As far as they are written; the faces with those of the coarsest mesh.
    blocks: u64,
    nodes: u64,
    faces: u64,
    failed: bool,
}

impl std::fmt::Debug for FileWriter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FileWriter")
            .field("path", &self.temporary.path())
            .field("header", &self.header)
            .field("pages", &self.entries.len())
            .finish_non_exhaustive()
    }
}

impl FileWriter {
    /// Begins a file with the coarsest mesh, whose roots are final ids. Where its vertices have colours, all nodes have.
    ///
    /// # Errors
    /// [`Error::Option`] and [`Error::PositionError`]; [`Error::InvalidBase`], also when its vertices are not
    /// [rounded](WriteOptions::rounding); [`Error::TooLarge`] when half-edges would have names of more than 32
    /// bits; [`Error::Io`] when the disk refuses.
    pub fn create(
        path: impl AsRef<Path>,
        options: &WriteOptions,
        totals: &Totals,
        base: &BaseMesh,
    ) -> Result<Self, Error> {
        let path = path.as_ref();
        let mut header = new_header(options, totals, base, options.rounding()?);
        header.check_names().map_err(|(half_edges, max)| Error::TooLarge {
            file: path.into(),
            half_edges,
            max,
        })?;
        check_base(base, &header)
            .map_err(|message| Error::InvalidBase { file: path.into(), message })?;
        let io = |source| Error::Io { file: path.into(), action: "write", source };
        let mut temporary = TemporaryFile::create(path).map_err(io)?;
        let mut at = header.encoded_len() as u64;
        let mut write = |tag: Tag, content: io::Result<Vec<u8>>| -> io::Result<Section> {
            let content = content?;
            let file = temporary.file();
            file.seek(SeekFrom::Start(at))?;
            file.write_all(&content)?;
            let length = content.len() as u64;
            let section = Section { offset: at, length, crc: tag.checksum(&content) };
            at += length;
            Ok(section)
        };
        header.base = write(Tag::Base, encode_base(base)).map_err(io)?;
        header.root_list = write(Tag::Roots, encode_roots(base, header.numbering())).map_err(io)?;
        Ok(Self {
            temporary,
            context: PageContext::new(&header),
            encoders: EncoderPool::default(),
            entries: Vec::new(),
            at,
            bytes: FieldBytes {
                header: header.encoded_len() as u64,
                base: header.base.length,
                roots: header.root_list.length,
                ..FieldBytes::default()
            },
            blocks: 0,
            nodes: 0,
            faces: header.base_faces,
            failed: false,
            header,
        })
    }

    /// Appends pages, in order of their numbers. They are encoded in parallel; the bytes do not depend on the number of
    /// threads, nor on how many pages come at once.
    ///
    /// # Errors
    /// [`Error::InvalidForest`], with a node's id, when a page or its links cannot be; [`Error::WrongTotals`] when it is
    /// one too many; [`Error::Io`] when the disk refuses. After an error the file cannot be finished.
    pub fn write_pages(&mut self, pages: &[Page]) -> Result<(), Error> {
        let result = pages.chunks(BATCH_PAGES).try_for_each(|batch| self.write_batch(batch));
        self.failed |= result.is_err();
        result
    }

    fn write_batch(&mut self, pages: &[Page]) -> Result<(), Error> {
        for page in pages {
            self.count(page)?;
        }
        let (encoders, context) = (&self.encoders, &self.context);
        let encoded: Vec<Result<_, Failure>> = pages
            .par_iter()
            .map_init(|| encoders.take(), |encoder, page| Ok(encoder.get()?.encode(page, context)?))
            .collect();
        for (page, encoded) in pages.iter().zip(encoded) {
            let written = encoded.and_then(|(bytes, fields)| {
                self.bytes.add(&fields);
                Ok(self.append(page, &bytes)?)
            });
            written.map_err(|failure| self.error(failure))?;
        }
        Ok(())
    }

    /// Checks that a page begins where the last one ended, within the totals.
    fn count(&mut self, page: &Page) -> Result<(), Error> {
        let numbering = self.context.numbering;
        if u64::from(page.first_block) != self.blocks || page.blocks.is_empty() {
            return Err(Error::InvalidForest {
                file: self.temporary.path().into(),
                node: numbering.node(page.first_block(), 0).index(),
                message: "begins a page that is empty or does not follow the one before",
            });
        }
        self.blocks += page.blocks.len() as u64;
        self.nodes += page.nodes.len() as u64;
        self.faces += page.nodes.iter().map(|node| node.num_faces() as u64).sum::<u64>();
        for (what, stated, written) in
            [("blocks", self.header.blocks, self.blocks), ("nodes", self.header.nodes, self.nodes)]
        {
            if written > stated {
                let file = self.temporary.path().into();
                return Err(Error::WrongTotals { file, what, stated, written });
            }
        }
        Ok(())
    }

    fn append(&mut self, page: &Page, bytes: &[u8]) -> io::Result<()> {
        self.temporary.file().write_all(bytes)?;
        self.entries.push(IndexEntry {
            first_block: page.first_block.into(),
            offset: self.at,
            length: u32::try_from(bytes.len()).map_err(io::Error::other)?,
            blocks: page.blocks.len() as u32,
            nodes: page.nodes.len() as u32,
            crc: Tag::Page(self.entries.len() as u64).checksum(bytes),
        });
        self.at += bytes.len() as u64;
        Ok(())
    }

    /// Ends the file and gives it its name.
    ///
    /// # Errors
    /// [`Error::WrongTotals`] when what was written is not what the totals say; [`Error::Invalid`] when the header that
    /// would be written is one that no reader takes, because of the rest of the totals or the options;
    /// [`Error::Io`] when the disk refuses, or refused before.
    pub fn finish(mut self) -> Result<WriteReport, Error> {
        if self.failed {
            return Err(self.error(io::Error::other("what was to be written before failed").into()));
        }
        for (what, stated, written) in [
            ("pages", self.header.pages, self.entries.len() as u64),
            ("blocks", self.header.blocks, self.blocks),
            ("nodes", self.header.nodes, self.nodes),
            ("triangles", self.header.input_triangles, self.faces),
        ] {
            if stated != written {
                let file = self.temporary.path().into();
                return Err(Error::WrongTotals { file, what, stated, written });
            }
        }
        let index = encode_index(&self.entries);
        let header = &mut self.header;
        let pages_at = header.root_list.offset + header.root_list.length;
        header.page_data = Section { offset: pages_at, length: self.at - pages_at, crc: 0 };
        header.index = Section {
            offset: self.at,
            length: index.len() as u64,
            crc: Tag::Index.checksum(&index),
        };
        header.file_len = self.at + header.index.length;
        let encoded = header.encode();
        if let Err(problem) = Header::decode(&encoded, header.file_len) {
            return Err(match problem {
                HeaderProblem::Defect(defect) => defect.in_file(self.temporary.path()),
                _ => self.error(io::Error::other("the header does not read back").into()),
            });
        }
        self.end(&index, &encoded).map_err(|source| self.error(source.into()))?;
        let report = WriteReport {
            file_bytes: self.header.file_len,
            blocks: self.header.blocks,
            pages: self.header.pages,
            fill: self.header.fill(),
            tree_depth: self.header.tree_depth,
            bytes: FieldBytes { index: self.header.index.length, ..self.bytes },
        };
        let path = self.temporary.path().to_owned();
        self.temporary.persist().map_err(|source| Error::Io {
            file: path,
            action: "write",
            source,
        })?;
        Ok(report)
    }

    fn end(&mut self, index: &[u8], header: &[u8]) -> io::Result<()> {
        let file = self.temporary.file();
        file.write_all(index)?;
        file.seek(SeekFrom::Start(0))?;
        file.write_all(header)
    }

    fn error(&self, failure: Failure) -> Error {
        let file = self.temporary.path().into();
        match failure {
            Failure::Io(source) => Error::Io { file, action: "write", source },
            Failure::Page(PageDefect { node, message }) => {
                Error::InvalidForest { file, node: node.index(), message }
            }
        }
    }
}

/// Why a page was not written.
enum Failure {
    Io(io::Error),
    Page(PageDefect),
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

impl From<PageDefect> for Failure {
    fn from(defect: PageDefect) -> Self {
        Self::Page(defect)
    }
}

/// Encoders that are not in use: a compressor takes longer to set up than a page to compress.
#[derive(Default)]
struct EncoderPool {
    idle: Mutex<Vec<PageEncoder>>,
}

/// An encoder that goes back to its pool.
struct PooledEncoder<'a> {
    pool: &'a EncoderPool,
    encoder: Option<PageEncoder>,
}

impl EncoderPool {
    fn take(&self) -> PooledEncoder<'_> {
        let encoder = self.idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
        PooledEncoder { pool: self, encoder }
    }
}

impl PooledEncoder<'_> {
    fn get(&mut self) -> io::Result<&mut PageEncoder> {
        match &mut self.encoder {
            Some(encoder) => Ok(encoder),
            none => Ok(none.insert(PageEncoder::new()?)),
        }
    }
}

impl Drop for PooledEncoder<'_> {
    fn drop(&mut self) {
        self.pool.idle.lock().unwrap_or_else(PoisonError::into_inner).extend(self.encoder.take());
    }
}

fn new_header(
    options: &WriteOptions,
    totals: &Totals,
    base: &BaseMesh,
    rounding: Rounding,
) -> Header {
    let mut attributes = standard_attributes();
    if !base.colours.is_empty() {
        attributes.push(Attribute::colour(options.encoding));
    }
    Header {
        version: VERSION,
        features: 0,
        encoding: options.encoding,
        levels: options.levels,
        input_triangles: totals.input_triangles,
        nodes: totals.nodes,
        blocks: totals.blocks,
        pages: totals.pages,
        base_vertices: base.vertices.len() as u64,
        base_faces: base.faces.len() as u64,
        roots: base.roots().count() as u64,
        tree_depth: totals.tree_depth,
        // Whether a zero is the negative one hangs on the order in which positions are looked at.
        bounds: totals.bounds.map(|corner| corner + Vec3::ZERO),
        origin: options.origin,
        precision: options.precision,
        rounding,
        attributes,
        base: Section::default(),
        root_list: Section::default(),
        page_data: Section::default(),
        index: Section::default(),
        file_len: 0,
    }
}

fn check_base(base: &BaseMesh, header: &Header) -> Result<(), String> {
    let [vertices, colours] = [base.vertices.len(), base.colours.len()];
    if colours != 0 && colours != vertices {
        return Err(format!("there are {colours} colours for {vertices} vertices"));
    }
    if let Some(vertex) = base.vertices.iter().position(|v| !v.position.is_finite()) {
        return Err(format!("the position of vertex {vertex} is not finite"));
    }
    let moved = |v: &mergetree::BaseVertex| !header.rounding.is_rounded(v.position, v.normal);
    if let Some(vertex) = base.vertices.iter().position(moved) {
        return Err(format!("vertex {vertex} is not where the grid is, or beyond it"));
    }
    let outside = |face: &[u32; 3]| face.iter().any(|&v| v as usize >= base.vertices.len());
    if let Some(face) = base.faces.iter().position(outside) {
        return Err(format!("face {face} names a vertex that is not there"));
    }
    let numbering = header.numbering();
    let no_root = |&root: &mergetree::NodeId| {
        numbering.slot(root) != 0 || u64::from(numbering.block(root).get()) >= header.blocks
    };
    if let Some(root) = base.roots().find(no_root) {
        return Err(format!("node {root} does not begin a block, and so is no root"));
    }
    Ok(())
}
