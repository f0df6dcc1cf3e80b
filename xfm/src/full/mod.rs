//! The finest mesh of a file of any size, in bounded memory.
//!
//! The front would hold the whole mesh. But what the finest mesh is can be told without making it step by step:
//!
//! 1. *Links.* The reverse of a half-edge changes when a split puts a face between it and what was its reverse. So in the
//!    finest mesh it is what the split of least order that names the half-edge says, or else what the node says that brought it.
//!    Every naming goes to a bucket by half-edge, and bucket by bucket the least order wins (`links.rs`).
//! 2. *Corners.* Where a node has no left child, no split takes the half-edge `h` away from the vertex `v` that it brings;
//!    where it has no right child, none takes `a` away from the vertex `u` that stays. Every vertex is that of exactly one
//!    such missing child, if it is not one of the coarsest mesh without a tree. From that half-edge a walk around the vertex
//!    finds all corners that are its own (`corners.rs`).
//!
//! Half-edges lie in a table by name, most of which is in a scratch file. Those around a vertex have been brought by nodes
//! near each other in the trees, and so have names near each other, mostly.

mod corners;
mod links;
mod mesh;

use bytemuck::{Pod, Zeroable};
use mergetree::{HalfEdgeName, HalfEdgeNames};
use scratch::{Scratch, TableOptions};
use xfm_format::XfmFile;

use crate::Error;

pub use mesh::FullMesh;

/// A half-edge of the finest mesh. All zero where there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
struct Corner {
    /// Two more than the name of its reverse; [`NO_REVERSE`] on a boundary.
    reverse: u32,
    /// One more than the number of the vertex that it begins at; 0 where that is not known.
    vertex: u32,
}

const NO_REVERSE: u32 = 1;

impl Corner {
    /// Of a half-edge that is there.
    fn with_reverse(reverse: Option<u32>) -> Self {
        // Names are below 2^32 − 2, as the file was checked to have no more half-edges.
        Self { reverse: reverse.map_or(NO_REVERSE, |name| name + 2), vertex: 0 }
    }

    fn is_there(self) -> bool {
        self.reverse != 0
    }

    fn reverse(self) -> Option<u32> {
        self.reverse.checked_sub(2)
    }

    fn vertex(self) -> Option<u32> {
        self.vertex.checked_sub(1)
    }
}

/// How much there may be of what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Shares {
    /// Half-edges of a bucket.
    bucket: u64,
    /// Bytes that buckets are written in at once.
    chunk_bytes: usize,
    /// Bytes of buckets that are held in memory.
    held: u64,
    /// Bytes of half-edges in memory while they are linked, and later.
    linking: u64,
    walking: u64,
    /// Bytes of other tables.
    other: u64,
    /// Bytes of a table that are written and read at once.
    table_chunk: usize,
}

/// What is not spent on tables: the program, a page and its reader, buffers of the output.
const ALWAYS: u64 = 16 << 20;
/// Tables are not smaller together, whatever is allowed.
const LEAST: u64 = 2 << 20;
/// Bytes of a half-edge while its bucket is linked.
const LINK_BYTES: u64 = 8;

impl Shares {
    fn new(memory: u64, taken: u64, half_edges: u64) -> Self {
        let tables = memory.saturating_sub(taken + ALWAYS).max(LEAST);
        let bucket = (tables / 4 / LINK_BYTES).max(1);
        let buckets = half_edges.div_ceil(bucket).max(1);
        // Every bucket has a chunk that is being written.
        let chunk = (tables / 4 / buckets) as usize & !63;
        Self {
            bucket,
            chunk_bytes: chunk.clamp(4 << 10, 256 << 10),
            held: tables / 8,
            linking: tables / 4,
            walking: tables / 8 * 5,
            other: tables / 4,
            table_chunk: TableOptions::default().chunk_bytes,
        }
    }

    /// For a table of which so many bytes may be in memory.
    fn table(&self, memory_bytes: u64) -> TableOptions {
        let mut options = TableOptions::default();
        options.chunk_bytes = self.table_chunk;
        options.memory_bytes = memory_bytes;
        options
    }
}

/// Anonymous memory that the finest mesh takes per triangle in core, at its peak and with a reserve.
const IN_CORE_BYTES: u64 = 160;
/// And so much more with colours: of nodes, of the front, and of the mesh.
const IN_CORE_COLOUR_BYTES: u64 = 8;

/// Whether the finest mesh of a file can be had within so many bytes in core, by its front.
pub fn fits_in_core(file: &XfmFile, memory: u64) -> bool {
    let colours = if file.header().has_colour() { IN_CORE_COLOUR_BYTES } else { 0 };
    let per_triangle = IN_CORE_BYTES + colours;
    file.header().input_triangles.saturating_mul(per_triangle).saturating_add(ALWAYS) <= memory
}

/// Finds the finest mesh of a file.
///
/// `memory` is for all of the process, in bytes; what little is always needed is taken even if it is more.
///
/// # Complexity
///
/// Time: two passes over the file, and a walk over all half-edges; linear as long as those around a vertex are found in
/// memory. Scratch space: about 100 bytes per node, less what fits into memory.
///
/// # Errors
///
/// A file that cannot be read or whose nodes contradict each other; scratch files that cannot be written; Ctrl-C.
pub fn full_mesh<'a>(
    file: &'a XfmFile,
    scratch: &Scratch,
    memory: u64,
) -> Result<FullMesh<'a>, Error> {
    let taken = (file.memory_bytes() + file.largest_page_bytes().iter().sum::<usize>()) as u64;
    full_mesh_with(file, scratch, Shares::new(memory, taken, num_half_edges(file)))
}

/// One more than the largest name of a half-edge.
fn num_half_edges(file: &XfmFile) -> u64 {
    let ids = (file.num_blocks() as u64) << file.numbering().levels();
    3 * file.base().faces.len() as u64 + 6 * ids
}

fn full_mesh_with<'a>(
    file: &'a XfmFile,
    scratch: &Scratch,
    shares: Shares,
) -> Result<FullMesh<'a>, Error> {
    let names = HalfEdgeNames::new(file.base().faces.len());
    let half_edges = num_half_edges(file);
    let links = links::Links { file, scratch, names, half_edges, shares };
    let (mut table, bucket_bytes) = links.find()?;
    table.set_memory_bytes(shares.walking)?;
    let found = corners::find(file, scratch, names, &mut table, &shares)?;
    table.set_memory_bytes(shares.other)?;
    let scratch_bytes = bucket_bytes + table.peak_file_bytes() + found.scratch_bytes;
    let positions = shares.table(shares.walking);
    Ok(FullMesh::new(file, scratch, table, found.base_vertices, positions, scratch_bytes))
}

/// That a file contradicts itself.
fn damaged(file: &XfmFile) -> Error {
    Error::DamagedNodes { file: file.path().to_owned(), nodes: 1 }
}

/// The half-edge after this one in its face, and the one before.
fn next(names: HalfEdgeNames, h: u32) -> u32 {
    let corner = corner_of(names, h);
    if corner == 2 { h - 2 } else { h + 1 }
}

fn previous(names: HalfEdgeNames, h: u32) -> u32 {
    let corner = corner_of(names, h);
    if corner == 0 { h + 2 } else { h - 1 }
}

/// Which half-edge of its face it is.
fn corner_of(names: HalfEdgeNames, h: u32) -> u32 {
    // Names of the coarsest mesh's half-edges are a multiple of three, and so are the six of a node.
    match names.resolve(halfedge::HalfEdgeId::new(h)) {
        HalfEdgeName::Base(h) => h % 3,
        HalfEdgeName::Node(_, k) => k % 3,
    }
}

#[cfg(test)]
mod tests;
