//! What memory is spent on, so that there is never more of it than was allowed.
//!
//! | stage | bytes |
//! | --- | --- |
//! | link | tables: 36 per name of a vertex, an eighth per name of a face; [`BUFFERS`] chunks; a reserve; the rest holds the log |
//! | number | tables: 40 per name of a vertex, 4 per name of a face; [`BUFFERS`] chunks; a chunk per bucket; what is held |
//! | write | two buckets, [`BUCKET_NODE_BYTES`] per node; 64 pages and their encoders; what is held |
//!
//! Where vertices have colours, the log, the buckets and their pages take 4 bytes per node more, and another chunk each.
//!
//! Beside these, what grows with the number of nodes, slowly: lists of chunks and pages, together about a byte per
//! node; and the coarsest mesh. While linking these come out of the reserve, and it is an error when they do not fit into it.

use mergetree::{CutRule, HalfEdgeNames, PagePacker};
use xfm_format::{Numbering, WriteOptions};

use crate::Error;
use crate::bucket::Placed;
use crate::link::LinkOptions;
use crate::log::LogEntry;
use crate::names::{MAX_VERTEX, NameBounds};

/// Of a vertex' table entry while linking.
pub(crate) const TOP_BYTES: u64 = 32;
/// Of a vertex' table entry while numbering, with the piece that may be open for it. While pieces are packed it is less.
const EXPECTED_BYTES: u64 = 16 + 24;
/// Of a colour, where vertices have some: in the log, in a bucket, and in pages.
const COLOUR_BYTES: u64 = 4;
/// Of a face's.
const FACE_BYTES: u64 = 4;
/// Of a node in a bucket that is made into pages, with its share of a block.
const BUCKET_NODE_BYTES: u64 = 72;
/// Chunks that are written to or read from at once, buckets excepted.
const BUFFERS: u64 = 8;
/// For each chunk the list it is in and the one of places that are free in the file.
const CHUNK_LIST_BYTES: u64 = 36;
/// For each page its size, its entry in the page index, and its share of the page index when that is encoded.
const PAGE_LIST_BYTES: u64 = 192;
/// For each page that pieces are packed into, twice: a page of the file is up to a few of these.
const DRAFT_BYTES: u64 = 2 * PagePacker::PAGE_BYTES as u64;
/// For each vertex and face of the coarsest mesh while it is taken over.
const LINK_BASE_VERTEX_BYTES: u64 = 80;
const LINK_BASE_FACE_BYTES: u64 = 24;
/// And later, with what encoding them takes.
const BASE_VERTEX_BYTES: u64 = 128;
const BASE_FACE_BYTES: u64 = 64;
/// What grows slowly has this much room while linking, and a quarter of what is not needed otherwise.
const LEAST_RESERVE: u64 = 512 << 10;
/// What grows with nothing at all.
const ALWAYS: u64 = 64 << 10;
/// Chunks are not smaller.
pub(crate) const LEAST_CHUNK_BYTES: usize = 4 << 10;
/// And not larger.
const MAX_CHUNK_BYTES: usize = 256 << 10;
/// Encoders and the pages they work on take so much for each node of a page, 64 pages at a time.
const PAGES_BYTES: u64 = 64 * 160;
/// And so much for each thread.
const ENCODER_BYTES: u64 = 2 << 20;
/// Nodes of a bucket at most: more is not faster.
const MAX_BUCKET_NODES: u64 = 1 << 19;

/// Memory while linking.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LinkPlan {
    pub chunk_bytes: usize,
    /// Bytes of the log that stay in memory.
    pub held: u64,
    memory_bytes: u64,
    reserve: u64,
    /// Of each node.
    colour_bytes: u64,
}

impl LinkPlan {
    /// Bytes of memory that linking takes at least, with chunks of this size.
    pub fn least(names: NameBounds, chunk_bytes: usize, colours: bool) -> u64 {
        let NameBounds { vertices, faces } = names;
        // When the last collapse has come the names of the coarsest mesh are checked as well.
        let tables = (TOP_BYTES + 4) * u64::from(vertices) + u64::from(faces) / 8;
        ALWAYS + tables + (BUFFERS + u64::from(colours)) * chunk_bytes as u64 + LEAST_RESERVE
    }

    pub fn new(options: &LinkOptions) -> Result<Self, Error> {
        options.write.check()?;
        let NameBounds { vertices, faces } = options.names;
        if vertices > MAX_VERTEX + 1 || u64::from(faces) > (1 << 32) / 3 {
            return Err(Error::Names { vertices, faces });
        }
        let (memory_bytes, chunk_bytes) = (options.memory_bytes, chunk_bytes(options.memory_bytes));
        let needed = Self::least(options.names, chunk_bytes, options.colours);
        let Some(rest) = memory_bytes.checked_sub(needed) else {
            return Err(Error::Memory { needed, allowed: memory_bytes });
        };
        let reserve = LEAST_RESERVE + rest / 4;
        let colour_bytes = colour_bytes(options.colours);
        Ok(Self { chunk_bytes, held: rest - rest / 4, memory_bytes, reserve, colour_bytes })
    }

    /// Bytes of the log for each node.
    fn log_bytes(&self) -> u64 {
        size_of::<LogEntry>() as u64 + self.colour_bytes
    }

    /// Nodes whose log has room in the lists, with half of the reserve.
    pub fn max_nodes(&self) -> u64 {
        let per_chunk = self.chunk_bytes as u64 / self.log_bytes();
        self.reserve / 2 / CHUNK_LIST_BYTES * per_chunk
    }

    /// That a log of so many nodes has room in the lists, and a coarsest mesh in the other half of the reserve.
    pub fn check(&self, nodes: u64, vertices: usize, faces: usize) -> Result<(), Error> {
        let base = LINK_BASE_VERTEX_BYTES * vertices as u64 + LINK_BASE_FACE_BYTES * faces as u64;
        let per_chunk = self.chunk_bytes as u64 / self.log_bytes();
        let lists = nodes.div_ceil(per_chunk) * CHUNK_LIST_BYTES;
        let over = base.max(lists).saturating_sub(self.reserve / 2);
        if over == 0 {
            return Ok(());
        }
        // Half of a quarter of what more there is; with more memory chunks may be larger.
        let larger = BUFFERS * MAX_CHUNK_BYTES as u64;
        let needed = self.memory_bytes.saturating_add(over.saturating_mul(8) + larger);
        Err(Error::Memory { needed, allowed: self.memory_bytes })
    }

    /// Scratch space for so many nodes: that of the log less what stays in memory, or of the log and the buckets.
    pub fn scratch_bytes(&self, nodes: u64, is_kept: bool) -> u64 {
        let log = nodes.saturating_mul(self.log_bytes());
        let placed = size_of::<Placed>() as u64 + self.colour_bytes;
        match is_kept {
            true => log.saturating_add(nodes.saturating_mul(placed)),
            false => log.saturating_sub(self.held),
        }
    }
}

/// What a checkpoint takes for names below these, beside a list of 12 bytes per chunk of the log and what the one who
/// collapses adds.
pub(crate) fn checkpoint_bytes(names: NameBounds) -> u64 {
    (1 << 20) + TOP_BYTES * u64::from(names.vertices)
}

/// Memory while numbering and writing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NumberPlan {
    /// Bytes of log and buckets that stay in memory.
    pub held: u64,
    /// Nodes of a bucket; one page is never divided.
    pub bucket_nodes: u32,
}

/// What numbering has to do with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NumberLoad {
    pub names: NameBounds,
    pub nodes: u64,
    pub page_nodes: u64,
    pub base_vertices: usize,
    pub base_faces: usize,
    pub chunk_bytes: u64,
    /// Bytes that are held in memory now.
    pub held: u64,
    pub threads: u64,
    /// Whether vertices have colours.
    pub colours: bool,
}

impl NumberPlan {
    /// Bytes of memory that are taken with buckets of so many nodes.
    fn needed(load: &NumberLoad, bucket_nodes: u64) -> u64 {
        let NumberLoad { names, nodes, page_nodes, chunk_bytes, held, threads, .. } = *load;
        // Of the log at first and of the buckets in the end, and never of both.
        let colour = colour_bytes(load.colours);
        let chunks = (size_of::<LogEntry>() as u64 + colour) * nodes / chunk_bytes;
        let buckets = nodes.div_ceil(bucket_nodes) + 1;
        // With colours two of each.
        let spools = if load.colours { 2 * buckets } else { buckets };
        let drafts = Self::max_drafts(load);
        let lists = CHUNK_LIST_BYTES * (chunks + 64 * spools)
            + PAGE_LIST_BYTES * drafts / 2
            + DRAFT_BYTES * drafts;
        let base = (BASE_VERTEX_BYTES + 2 * colour) * load.base_vertices as u64
            + BASE_FACE_BYTES * load.base_faces as u64;
        let buffers = BUFFERS + 2 * u64::from(load.colours);
        let fixed = ALWAYS + held + lists + base + buffers * chunk_bytes;
        let tables =
            EXPECTED_BYTES * u64::from(names.vertices) + FACE_BYTES * u64::from(names.faces);
        let numbering = tables + chunk_bytes * spools;
        let encoding = (PAGES_BYTES + 64 * 4 * colour) * page_nodes + ENCODER_BYTES * threads;
        let writing = encoding + 2 * (BUCKET_NODE_BYTES + colour) * bucket_nodes;
        fixed + numbering.max(writing)
    }

    /// Pages that pieces may be packed into, before small ones share one: of balanced trees there are half as many.
    pub fn max_drafts(load: &NumberLoad) -> u64 {
        64 + 4 * load.nodes / load.page_nodes.max(1) + load.base_vertices as u64
    }

    /// Sizes that buckets may have: from a page on.
    fn sizes(load: &NumberLoad) -> impl Iterator<Item = u64> {
        let nodes = load.nodes;
        let larger = move |&size: &u64| (size < nodes).then_some(2 * size);
        std::iter::successors(Some(load.page_nodes.max(1)), larger)
    }

    /// Bytes of memory that numbering and writing take at least.
    pub fn least(load: &NumberLoad) -> u64 {
        Self::sizes(load).map(|size| Self::needed(load, size)).min().unwrap_or(u64::MAX)
    }

    pub fn new(memory_bytes: u64, load: &NumberLoad) -> Result<Self, Error> {
        let fits = |&size: &u64| Self::needed(load, size) <= memory_bytes;
        let of_use = || Self::sizes(load).take_while(|&size| size <= MAX_BUCKET_NODES);
        let largest = of_use().filter(fits).last();
        let Some(bucket_nodes) = largest.or_else(|| Self::sizes(load).find(fits)) else {
            return Err(Error::Memory { needed: Self::least(load), allowed: memory_bytes });
        };
        let held = load.held + memory_bytes - Self::needed(load, bucket_nodes);
        Ok(Self { held, bucket_nodes: u32::try_from(bucket_nodes).unwrap_or(u32::MAX) })
    }
}

fn colour_bytes(colours: bool) -> u64 {
    if colours { COLOUR_BYTES } else { 0 }
}

/// Chunks grow with the memory, so that there are neither too many of them in a large log, nor too few in memory.
fn chunk_bytes(memory_bytes: u64) -> usize {
    let bytes = (memory_bytes / 4096).next_power_of_two();
    bytes.clamp(LEAST_CHUNK_BYTES as u64, MAX_CHUNK_BYTES as u64) as usize
}

/// Blocks that can have numbers: the ids of the nodes of all of them have names for six half-edges each.
pub(crate) fn max_blocks(names: HalfEdgeNames, numbering: Numbering) -> u64 {
    u64::from(names.max_node().get() >> numbering.levels())
}

pub(crate) fn cut_rule(options: &WriteOptions) -> CutRule {
    CutRule { block_nodes: (1 << options.levels) - 1, page_nodes: options.piece_nodes() as u32 }
}
