//! From triangles to the file: the whole line, in core or out of core, as the memory allows.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::Path;

use mergetree::{CollapseRecord, OctNormal, StarBounds};
use mesh_io::TriangleSource;
use scratch::Scratch;
use stream_decimate::{
    CollapseOptions, CollapseReport, Collapsed, CollapsedMesh, ReadOrder, collapse, collapse_file,
};
use xfm_format::WriteOptions;

use crate::build::{BuildOptions, BuildReport, Feed, build_from};
use crate::kept::Keep;
use crate::link::LinkOptions;
use crate::names::{CoarseFace, CoarseMesh, CoarseVertex, NameBounds};
use crate::number::NumberOptions;
use crate::{Error, Progress};

/// Memory of the process itself, and of reading.
const ALWAYS: u64 = 40 << 20;
/// Memory that the linker takes for its tables per vertex of the buffer, in bytes.
const LINK_TABLES: u64 = 41;
/// Memory for the log per triangle, in bytes, where it is to stay in memory: half a node.
const LOG: u64 = 28;
/// And so much more of it where vertices have colours.
const LOG_COLOUR: u64 = 2;
/// Share of the memory that goes to the buffer and the tables that go with it, in streaming, in percent.
const BUFFER_SHARE: u64 = 66;
/// Buffers are not smaller than this, in triangles.
const LEAST_BUFFER: u64 = 1 << 14;
/// Nor larger: more does not make better files.
const MOST_BUFFER: u64 = 1 << 26;

/// Where triangles come from.
pub enum Input<'a> {
    /// They can be read once.
    Pipe(&'a mut (dyn TriangleSource + Send)),
    /// They can be read again.
    File(&'a mut dyn FnMut() -> Result<Box<dyn TriangleSource + Send>, mesh_io::Error>),
}

/// Whether the whole mesh is in memory at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Mode {
    /// It is.
    InCore,
    /// Only a buffer of it is.
    Streaming,
}

/// How a mesh becomes a file.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct MeshOptions {
    /// Anonymous memory that may be taken, in bytes; a promise. Default 1 GiB.
    pub memory_bytes: u64,
    /// Triangles that are expected, where that is known; so it is known whether the mesh fits into memory. Default `None`.
    pub expected_triangles: Option<u64>,
    /// Whether to build in core. Default `None`: if the mesh is known to fit.
    pub mode: Option<Mode>,
    /// Threads to use at most; the file does not depend on it. Default `None`: as many as there are cores.
    pub threads: Option<NonZeroUsize>,
    /// How the file is written.
    pub write: WriteOptions,
    /// Where the log is kept for a later run. Default `None`.
    pub keep: Option<Keep>,
    /// Whether vertices have colours, which take some memory; [`build_mesh`] finds that out by itself. Default no.
    pub colours: bool,
    /// How much colours count in the order of collapses; see [`CollapseOptions::colour_weight`]. Default as there.
    pub colour_weight: f32,
}

impl Default for MeshOptions {
    fn default() -> Self {
        Self {
            memory_bytes: 1 << 30,
            expected_triangles: None,
            mode: None,
            threads: None,
            write: WriteOptions::default(),
            keep: None,
            colours: false,
            colour_weight: CollapseOptions::default().colour_weight,
        }
    }
}

/// What memory is spent on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct MemoryPlan {
    /// Whether the whole mesh is in memory at once.
    pub mode: Mode,
    /// Triangles the buffer holds.
    pub buffer_triangles: usize,
    /// Vertices it holds.
    pub buffer_vertices: usize,
    /// Bytes that the linker may take while collapses come.
    pub link_bytes: u64,
    /// Bytes that may be taken after that.
    pub number_bytes: u64,
}

impl MeshOptions {
    /// Memory that so many triangles take in core, in bytes, with some more vertices than a closed mesh has, with
    /// [colours](Self::colours) or without.
    pub fn in_core_bytes(&self, triangles: u64) -> u64 {
        let log = triangles.saturating_mul(LOG + if self.colours { LOG_COLOUR } else { 0 });
        buffer_bytes(triangles, triangles / 8 * 5, self.colours)
            .saturating_add(log)
            .saturating_add(ALWAYS + (4 << 20))
    }

    /// What the memory is spent on.
    pub fn plan(&self) -> MemoryPlan {
        let rest = self.memory_bytes.saturating_sub(ALWAYS);
        let colours = self.colours;
        let log = LOG + if colours { LOG_COLOUR } else { 0 };
        let in_core = |&triangles: &u64| self.in_core_bytes(triangles) <= self.memory_bytes;
        let fits = self.expected_triangles.filter(in_core);
        let mode = self.mode.unwrap_or(if fits.is_some() { Mode::InCore } else { Mode::Streaming });
        // Triangles of a closed mesh, and half as many again of its vertices.
        let per_triangle = buffer_bytes(4, 3, colours) / 4;
        let most = (rest / 100 * BUFFER_SHARE / per_triangle).clamp(LEAST_BUFFER, MOST_BUFFER);
        let buffer = match (mode, self.expected_triangles) {
            (Mode::InCore, Some(triangles)) => triangles.saturating_add(64),
            // Of unknown length: as much as there may be.
            (Mode::InCore, None) => rest / (per_triangle + log),
            (Mode::Streaming, Some(triangles)) => most.min(triangles.saturating_add(64)),
            (Mode::Streaming, None) => most,
        };
        let triangles = buffer.max(64);
        let vertices = match mode {
            Mode::Streaming => triangles / 4 * 3,
            // There may be three of a triangle, but no more than there is memory for.
            Mode::InCore => {
                let for_vertices =
                    rest.saturating_sub(buffer_bytes(triangles, 0, colours) + triangles * log);
                let each = buffer_bytes(0, 1, colours);
                (for_vertices / each).clamp(triangles / 2 + 64, triangles.saturating_mul(3))
            }
        };
        let tables = vertices.saturating_mul(LINK_TABLES) + triangles / 8 + (4 << 20);
        let taken =
            buffer_bytes(triangles, vertices, colours) - vertices.saturating_mul(LINK_TABLES);
        MemoryPlan {
            mode,
            buffer_triangles: triangles as usize,
            buffer_vertices: vertices as usize,
            link_bytes: rest.saturating_sub(taken).max(tables),
            // Encoders and the allocator keep a little more than they are asked for.
            number_bytes: (rest - rest / 6).max(24 << 20),
        }
    }
}

/// Memory that a buffer takes with the tables of the linker, in bytes.
fn buffer_bytes(triangles: u64, vertices: u64, colours: bool) -> u64 {
    let of_triangles = triangles.saturating_mul(CollapseOptions::BYTES_PER_TRIANGLE);
    let colour = if colours { CollapseOptions::COLOUR_BYTES_PER_VERTEX } else { 0 };
    let of_vertex = CollapseOptions::BYTES_PER_VERTEX + LINK_TABLES + colour;
    of_triangles.saturating_add(vertices.saturating_mul(of_vertex))
}

/// What came of it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct MeshReport {
    /// What was built.
    pub built: BuildReport,
    /// What was read.
    pub collapse: CollapseReport,
    /// Whether the whole mesh was in memory at once.
    pub mode: Mode,
    /// In what order it was read.
    pub order: ReadOrder,
}

/// Why a mesh could not be made into a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// The collapses could not be linked, numbered or written.
    #[error(transparent)]
    Build(#[from] Error),
    /// No triangle is left after repair.
    #[error("there is no triangle with three different corners")]
    Empty,
    /// The triangles could not be read or collapsed.
    #[error(transparent)]
    Collapse(#[from] stream_decimate::Error),
}

/// How far it is.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum MeshProgress {
    /// Triangles are read and collapsed.
    Collapse(stream_decimate::Progress),
    /// Nodes are numbered or written.
    Build(Progress),
}

/// Builds a file of a mesh.
///
/// A file whose triangles are in no good order is read again: once to learn where each vertex is used for the last time,
/// or sorted.
///
/// # Errors
/// Those of reading, collapsing, linking, numbering and writing; nothing is left then.
pub fn build_mesh(
    mut input: Input<'_>,
    path: &Path,
    scratch: &Path,
    options: &MeshOptions,
    observer: &mut dyn FnMut(MeshProgress) -> ControlFlow<()>,
) -> Result<MeshReport, MeshError> {
    let mut numbered = false;
    let mut options = options.clone();
    options.colours = match &mut input {
        Input::Pipe(source) => source.has_colours(),
        Input::File(open) => {
            let source = open().map_err(stream_decimate::Error::from)?;
            numbered = source.has_vertex_numbers();
            source.has_colours()
        }
    };
    let options = &options;
    let plan = options.plan();
    let mut collapse_options = CollapseOptions::default();
    collapse_options.buffer_triangles = plan.buffer_triangles;
    collapse_options.buffer_vertices = Some(plan.buffer_vertices);
    collapse_options.threads = options.threads;
    collapse_options.colour_weight = options.colour_weight;
    let mut line = Line { path, scratch, options, plan, collapse_options };
    match input {
        Input::Pipe(source) => line.build(ReadOrder::AsIs, observer, |options, tell, observer| {
            collapse(source, options, tell, observer)
        }),
        Input::File(open) => {
            let orders = [ReadOrder::AsIs, ReadOrder::Counted, ReadOrder::Sorted];
            let mut orders = orders.into_iter().filter(|&o| numbered || o != ReadOrder::Counted);
            let mut order = ReadOrder::AsIs;
            loop {
                let built = line.build(order, observer, |options, tell, observer| {
                    collapse_file(open, order, scratch, options, tell, observer)
                });
                let unsorted = matches!(
                    built,
                    Err(MeshError::Collapse(stream_decimate::Error::Unsorted { .. }))
                );
                match orders.find(|&next| next as u8 > order as u8) {
                    Some(next) if unsorted => order = next,
                    _ => return built,
                }
            }
        }
    }
}

/// Tells a collapse.
type Tell<'a> = dyn FnMut(&Collapsed) -> Result<(), MeshError> + 'a;

struct Line<'a> {
    path: &'a Path,
    scratch: &'a Path,
    options: &'a MeshOptions,
    plan: MemoryPlan,
    collapse_options: CollapseOptions,
}

impl Line<'_> {
    fn build(
        &mut self,
        order: ReadOrder,
        observer: &mut dyn FnMut(MeshProgress) -> ControlFlow<()>,
        collapse: impl FnOnce(
            &CollapseOptions,
            &mut Tell<'_>,
            &mut stream_decimate::Observer<'_>,
        ) -> Result<(CollapsedMesh, CollapseReport), MeshError>,
    ) -> Result<MeshReport, MeshError> {
        let options = &self.collapse_options;
        let mut link = LinkOptions::new(NameBounds {
            vertices: options.num_vertex_names(),
            faces: options.num_face_names(),
        });
        link.memory_bytes = self.plan.link_bytes.max(link.least_memory_bytes());
        link.write = self.options.write.clone();
        link.colours = self.options.colours;
        let mut build_options = BuildOptions::new(link);
        build_options.number = NumberOptions { memory_bytes: self.plan.number_bytes };
        build_options.expected_nodes = self.options.expected_triangles.map(|count| count / 2);
        build_options.keep = self.options.keep.clone();
        let observer = std::cell::RefCell::new(observer);
        let mut collapsed = CollapseReport::default();
        let feed = |feed: &mut Feed| -> Result<CoarseMesh, MeshError> {
            let mut tell = |collapse: &Collapsed| -> Result<(), MeshError> {
                let (record, normal) = record_of(collapse);
                Ok(feed.push_with(&record, collapse.position, normal, collapse.colour)?)
            };
            let mut told = |progress: &stream_decimate::Progress| {
                (observer.borrow_mut())(MeshProgress::Collapse(*progress))
            };
            let (rest, report) = collapse(options, &mut tell, &mut told)?;
            collapsed = report;
            if rest.faces.is_empty() {
                return Err(MeshError::Empty);
            }
            Ok(coarse_mesh(&rest))
        };
        let mut told = |progress: Progress| (observer.borrow_mut())(MeshProgress::Build(progress));
        let folder = Scratch::new(self.scratch);
        let built = build_from(feed, self.path, &folder, &build_options, &mut told)?;
        Ok(MeshReport { built, collapse: collapsed, mode: self.plan.mode, order })
    }
}

fn record_of(collapse: &Collapsed) -> (CollapseRecord, OctNormal) {
    /// Normals are stored a little less precisely than the cone is measured.
    const NORMAL_ERROR: f32 = 1e-4;
    let star = StarBounds {
        radius: collapse.radius,
        cone_angle: collapse.cone_cosine.clamp(-1.0, 1.0).acos() + NORMAL_ERROR,
        deviation: collapse.deviation,
    };
    let &Collapsed { removed, kept, half_edge, reverse, adjacent, normal, .. } = collapse;
    let record = CollapseRecord {
        removed,
        kept,
        half_edge,
        reverse,
        adjacent,
        star,
        rank: Some(collapse.rank),
    };
    (record, OctNormal::new(normal))
}

fn coarse_mesh(rest: &CollapsedMesh) -> CoarseMesh {
    let vertex = |v: &stream_decimate::CollapsedVertex| CoarseVertex {
        name: v.name,
        position: v.position,
        normal: OctNormal::new(v.normal),
    };
    let face = |f: &stream_decimate::CollapsedFace| CoarseFace { name: f.name, corners: f.corners };
    CoarseMesh {
        vertices: rest.vertices.iter().map(vertex).collect(),
        faces: rest.faces.iter().map(face).collect(),
        colours: rest.vertices.iter().filter_map(|v| v.colour).collect(),
    }
}
