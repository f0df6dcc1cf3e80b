//! Reading a file, one page at a time or whole.

use std::fs::File;
use std::path::{Path, PathBuf};

use mergetree::{BaseMesh, Forest, HalfEdgeName, Node, NodeId};

use crate::codec::{FieldBytes, PageContext, PageDecoder};
use crate::error::{Error, Place};
use crate::header::{
    Encoding, Header, HeaderProblem, MAX_ATTRIBUTES, Section, VERSION, encoded_len,
};
use crate::numbering::{BlockId, Numbering};
use crate::page::Page;
use crate::sections::{IndexEntry, Tag, decode_base, decode_index, decode_roots};
use crate::storage::{ReadEnd, Storage, read_full};

/// An open `.xfm` file: header, coarsest mesh and page index in memory, pages on demand.
///
/// All ids are the file's, see [`Numbering`]; [`read_forest`](Self::read_forest) alone gives others.
pub struct XfmFile {
    path: PathBuf,
    storage: Box<dyn Storage>,
    header: Header,
    base: BaseMesh,
    index: Vec<IndexEntry>,
    context: PageContext,
}

impl std::fmt::Debug for XfmFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("XfmFile").field("path", &self.path).field("header", &self.header).finish()
    }
}

/// What the decompressor keeps for itself, rounded up.
const ZSTD_CONTEXT_BYTES: usize = 160 << 10;

/// Reads pages of a file; holds what can be used again from one to the next. One for each thread.
pub struct PageReader {
    decoder: PageDecoder,
    bytes: Vec<u8>,
}

impl XfmFile {
    /// Opens a file and reads all of it but its pages.
    ///
    /// # Complexity
    /// Time and memory linear in the coarsest mesh and the number of pages. Memory is at most 1024 times the length of
    /// the file, whatever is in it.
    ///
    /// # Errors
    /// All of [`Error`] that concerns reading. What has a wrong checksum is refused, pages excepted: those are read later.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let file = File::open(path).map_err(|source| Error::Io {
            file: path.into(),
            action: "open",
            source,
        })?;
        Self::from_storage(Box::new(file), path)
    }

    /// Opens what lies in a storage; `path` is its name in messages.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn from_storage(
        storage: Box<dyn Storage>,
        path: impl Into<PathBuf>,
    ) -> Result<Self, Error> {
        let path = path.into();
        let file_len = storage.len().map_err(|source| Error::Io {
            file: path.clone(),
            action: "find the length",
            source,
        })?;
        let source = Source { path: &path, storage: &*storage };
        let max_len = encoded_len(Encoding::Compact, MAX_ATTRIBUTES) as u64;
        let mut bytes = Vec::new();
        source.read(0, file_len.min(max_len), Place::Header, &mut bytes)?;
        let header = Header::decode(&bytes, file_len)
            .map_err(|problem| header_error(problem, &path, file_len))?;
        if file_len > header.file_len {
            let expected = header.file_len;
            return Err(Error::TrailingBytes { file: path, expected, found: file_len });
        }
        let in_file = |defect: crate::error::Defect| defect.in_file(&path);
        header.check_names().map_err(|(half_edges, max)| Error::TooLarge {
            file: path.clone(),
            half_edges,
            max,
        })?;
        source.section(header.base, Tag::Base, Place::Base, &mut bytes)?;
        let mut base = decode_base(&bytes, &header).map_err(in_file)?;
        source.section(header.root_list, Tag::Roots, Place::Roots, &mut bytes)?;
        decode_roots(&bytes, &header, &mut base).map_err(in_file)?;
        source.section(header.index, Tag::Index, Place::Index, &mut bytes)?;
        let index = decode_index(&bytes, &header).map_err(in_file)?;
        let context = PageContext::new(&header);
        Ok(Self { path, storage, header, base, index, context })
    }

    /// The name the file was opened by.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the header says.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The coarsest mesh, with roots in the file's numbering.
    pub fn base(&self) -> &BaseMesh {
        &self.base
    }

    /// How node ids are made of block and slot.
    pub fn numbering(&self) -> Numbering {
        self.context.numbering
    }

    /// Number of pages.
    pub fn num_pages(&self) -> usize {
        self.index.len()
    }

    /// Number of blocks.
    pub fn num_blocks(&self) -> usize {
        self.context.num_blocks as usize
    }

    /// The page that holds a block.
    ///
    /// # Complexity
    /// Logarithmic in the number of pages.
    pub fn block_page(&self, block: BlockId) -> Option<usize> {
        let block = u64::from(block.get());
        let after = self.index.partition_point(|entry| entry.first_block <= block);
        (block < self.context.num_blocks && after > 0).then(|| after - 1)
    }

    /// Length of a page in the file; `None` if there is no such page.
    pub fn page_bytes(&self, page: usize) -> Option<u64> {
        self.index.get(page).map(|entry| entry.length.into())
    }

    /// Blocks and nodes of a page; `None` if there is no such page.
    pub fn page_counts(&self, page: usize) -> Option<(usize, usize)> {
        self.index.get(page).map(|entry| (entry.blocks as usize, entry.nodes as usize))
    }

    /// The most that reading any page of this file takes in memory, first the [`Page`], then its [`PageReader`].
    ///
    /// # Complexity
    /// Linear in the number of pages.
    pub fn largest_page_bytes(&self) -> [usize; 2] {
        let largest = |get: fn(&IndexEntry) -> u32| {
            self.index.iter().map(get).max().unwrap_or_default() as usize
        };
        let [nodes, blocks, length] =
            [largest(|e| e.nodes), largest(|e| e.blocks), largest(|e| e.length)];
        let page = nodes * self.header.node_bytes() as usize + blocks * size_of::<u32>();
        // A column of values and its planes, a packed plane, references, ids, children outside and tops, each in memory
        // that may have doubled.
        let per_node = 8 + 8 + 1 + 8 + 4 + 2 * 8 + 1;
        [page, length + nodes * 2 * per_node + ZSTD_CONTEXT_BYTES]
    }

    /// Bytes that header, coarsest mesh and page index take in memory.
    pub fn memory_bytes(&self) -> usize {
        size_of_val(&self.index[..])
            + size_of_val(&self.base.vertices[..])
            + size_of_val(&self.base.faces[..])
            + size_of_val(&self.base.colours[..])
            + size_of::<Self>()
    }

    /// Something to read pages with.
    ///
    /// # Errors
    /// [`Error::Io`] when the decompressor cannot be set up.
    pub fn page_reader(&self) -> Result<PageReader, Error> {
        let decoder = PageDecoder::new().map_err(|source| Error::Io {
            file: self.path.clone(),
            action: "set up decompression",
            source,
        })?;
        Ok(PageReader { decoder, bytes: Vec::new() })
    }

    /// Reads a page into memory that is used again.
    ///
    /// Every link of its nodes is in range: to a block of the file, to a slot a block can have, to a half-edge the file
    /// can have. Whether there is a node at the other end is for [`crate::verify`] to say.
    ///
    /// # Complexity
    /// Time and memory linear in the nodes of the page.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Truncated`], [`Error::Checksum`] and [`Error::Invalid`]; then `page` is empty.
    ///
    /// # Panics
    /// When `number` is not below [`num_pages`](Self::num_pages).
    pub fn read_page_into(
        &self,
        number: usize,
        reader: &mut PageReader,
        page: &mut Page,
    ) -> Result<(), Error> {
        let result = self.try_read_page(number, reader, page);
        if result.is_err() {
            page.clear();
        }
        result
    }

    fn try_read_page(
        &self,
        number: usize,
        reader: &mut PageReader,
        page: &mut Page,
    ) -> Result<(), Error> {
        let entry = &self.index[number];
        let number = number as u64;
        let section = Section { offset: entry.offset, length: entry.length.into(), crc: entry.crc };
        let source = Source { path: &self.path, storage: &*self.storage };
        source.section(section, Tag::Page(number), Place::Page(number), &mut reader.bytes)?;
        reader
            .decoder
            .decode(&reader.bytes, number, entry, &self.context, page)
            .map_err(|defect| defect.in_file(&self.path))
    }

    /// Reads a page.
    ///
    /// # Errors
    /// As [`read_page_into`](Self::read_page_into).
    ///
    /// # Panics
    /// When `number` is not below [`num_pages`](Self::num_pages).
    pub fn read_page(&self, number: usize) -> Result<Page, Error> {
        let mut page = Page::new();
        self.read_page_into(number, &mut self.page_reader()?, &mut page)?;
        Ok(page)
    }

    /// The file's bytes by what they hold.
    ///
    /// # Complexity
    /// Reads all pages.
    ///
    /// # Errors
    /// As [`read_page_into`](Self::read_page_into).
    pub fn field_bytes(&self) -> Result<FieldBytes, Error> {
        let mut bytes = FieldBytes {
            header: self.header.encoded_len() as u64,
            base: self.header.base.length,
            roots: self.header.root_list.length,
            index: self.header.index.length,
            ..FieldBytes::default()
        };
        let mut reader = self.page_reader()?;
        let mut page = Page::new();
        for number in 0..self.num_pages() {
            self.read_page_into(number, &mut reader, &mut page)?;
            bytes.add(&reader.decoder.bytes);
        }
        Ok(bytes)
    }

    /// Reads the whole file as a forest in memory.
    ///
    /// A node's id there is its place in the order of ids in the file, without the gaps that blocks leave.
    ///
    /// # Complexity
    /// Time and memory linear in the number of nodes: 64 bytes per node, 4 more with colours, and 4 per block.
    ///
    /// # Errors
    /// As [`read_page_into`](Self::read_page_into), and [`Error::Invalid`] where a link leads to a slot without node.
    pub fn read_forest(&self) -> Result<Forest, Error> {
        let numbering = self.numbering();
        let mut nodes: Vec<Node> = Vec::with_capacity(self.header.nodes as usize);
        // Per block where its nodes begin, and where the last one ends.
        let mut starts: Vec<u32> = Vec::with_capacity(self.num_blocks() + 1);
        let mut colours = Vec::new();
        let mut reader = self.page_reader()?;
        let mut page = Page::new();
        for number in 0..self.num_pages() {
            self.read_page_into(number, &mut reader, &mut page)?;
            colours.extend_from_slice(&page.colours);
            starts.extend(page.blocks.iter().map(|&start| nodes.len() as u32 + start));
            nodes.extend_from_slice(&page.nodes);
        }
        starts.push(nodes.len() as u32);
        let names = self.context.names;
        let dense = |id: NodeId| -> Result<NodeId, Error> {
            let block = numbering.block(id).index();
            let id_there = starts.get(block).map(|&start| start + numbering.slot(id));
            id_there
                .filter(|id| starts.get(block + 1).is_some_and(|end| id < end))
                .map(NodeId::new)
                .ok_or_else(|| Error::Invalid {
                    file: self.path.clone(),
                    place: Place::Node(id.get().into()),
                    message: "is linked to and not there".into(),
                })
        };
        for node in &mut nodes {
            for link in [&mut node.left, &mut node.right, &mut node.parent].into_iter().flatten() {
                *link = dense(*link)?;
            }
            for half_edge in node.adjacent.iter_mut().flatten() {
                if let HalfEdgeName::Node(id, k) = names.resolve(*half_edge) {
                    *half_edge = names.of_node(dense(id)?, k);
                }
            }
        }
        let mut base = self.base.clone();
        for root in base.vertices.iter_mut().filter_map(|vertex| vertex.root.as_mut()) {
            *root = dense(*root)?;
        }
        Ok(Forest { base, nodes, colours })
    }
}

/// A storage and its name.
struct Source<'a> {
    path: &'a Path,
    storage: &'a dyn Storage,
}

impl Source<'_> {
    /// Reads so many bytes, which the file was found to have.
    fn read(
        &self,
        offset: u64,
        length: u64,
        place: Place,
        bytes: &mut Vec<u8>,
    ) -> Result<(), Error> {
        let too_long = || Error::Invalid {
            file: self.path.into(),
            place,
            message: format!("{length} bytes do not fit into memory"),
        };
        let len = usize::try_from(length).map_err(|_| too_long())?;
        bytes.clear();
        bytes.try_reserve_exact(len).map_err(|_| too_long())?;
        bytes.resize(len, 0);
        match read_full(self.storage, offset, bytes) {
            Ok(ReadEnd::Full) => Ok(()),
            Ok(ReadEnd::Short(found)) => Err(Error::Truncated {
                file: self.path.into(),
                place,
                needed: offset + length,
                found: offset + found as u64,
            }),
            Err(source) => Err(Error::Io { file: self.path.into(), action: "read", source }),
        }
    }

    /// Reads a section that lies within the file and checks its checksum.
    fn section(
        &self,
        section: Section,
        tag: Tag,
        place: Place,
        bytes: &mut Vec<u8>,
    ) -> Result<(), Error> {
        self.read(section.offset, section.length, place, bytes)?;
        let found = tag.checksum(bytes);
        if found != section.crc {
            let expected = section.crc;
            return Err(Error::Checksum { file: self.path.into(), place, expected, found });
        }
        Ok(())
    }
}

fn header_error(problem: HeaderProblem, path: &Path, file_len: u64) -> Error {
    let file = path.to_owned();
    match problem {
        HeaderProblem::NotXfm => Error::NotXfm { file },
        HeaderProblem::Version(found) => {
            Error::UnsupportedVersion { file, found, supported: VERSION }
        }
        HeaderProblem::Features(flags) => Error::UnsupportedFeatures { file, flags },
        HeaderProblem::Encoding(found) => Error::UnsupportedEncoding { file, found },
        HeaderProblem::Truncated(needed) => {
            Error::Truncated { file, place: Place::File, needed, found: file_len }
        }
        HeaderProblem::Checksum { expected, found } => {
            Error::Checksum { file, place: Place::Header, expected, found }
        }
        HeaderProblem::Defect(defect) => defect.in_file(path),
    }
}
