//! From triangles to the file: the whole line, in core or out of core, as the memory allows.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, Instant};

use mergetree::{CollapseRecord, OctNormal, StarBounds};
use mesh_io::TriangleSource;
use scratch::{CheckpointError, Scratch};
use stream_decimate::{
    CollapseOptions, CollapseReport, CollapseState, Collapsed, CollapsedMesh, Collapsing,
    ReadOrder, Recorder, check_input,
};
use xfm_format::WriteOptions;

use crate::build::{BuildOptions, BuildReport, Feed, build_from, finish, go_on_from};
use crate::kept::Keep;
use crate::link::{LinkOptions, Linked, Linker};
use crate::names::{CoarseFace, CoarseMesh, CoarseVertex, NameBounds};
use crate::number::NumberOptions;
use crate::pace::Pace;
use crate::{Error, Progress, StateProblem, plan};

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
    /// Where checkpoints and the log are kept for a later run, as long as there is no file; what an earlier run has left there is
    /// removed. Default `None`.
    pub keep: Option<Keep>,
    /// Whether to go on with what an earlier run has left there, if it left something. Default `false`.
    pub resume: bool,
    /// Time from one checkpoint to the next at least. Default `None`: such that they take a fiftieth of the time.
    pub checkpoint_every: Option<Duration>,
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
            resume: false,
            checkpoint_every: None,
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

    /// Bytes on the disk that checkpoints take at most, where they are kept.
    pub fn checkpoint_bytes(&self) -> u64 {
        let options = self.collapse_options();
        2 * (options.checkpoint_bytes() + plan::checkpoint_bytes(names(&options)))
    }

    fn collapse_options(&self) -> CollapseOptions {
        let plan = self.plan();
        let mut options = CollapseOptions::default();
        options.buffer_triangles = plan.buffer_triangles;
        options.buffer_vertices = Some(plan.buffer_vertices);
        options.threads = self.threads;
        options.colours = self.colours;
        options.colour_weight = self.colour_weight;
        options
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
            // Of a mesh that fits there may be as many as there is memory for: up to three of each triangle.
            Mode::Streaming => (most.max(triangles) / 4 * 3).min(triangles.saturating_mul(3)),
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

fn names(options: &CollapseOptions) -> NameBounds {
    NameBounds { vertices: options.num_vertex_names(), faces: options.num_face_names() }
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
    /// Whether an earlier run was gone on with.
    pub resumed: bool,
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
/// With [`MeshOptions::keep`] a run that is broken off, however that is, leaves its last checkpoint, and
/// [`MeshOptions::resume`] goes on from there to the same file. Nothing is believed of what was left: where anything is wrong
/// with it, it is an error that says what.
///
/// # Errors
/// Those of reading, collapsing, linking, numbering and writing; nothing is left then but what is kept.
pub fn build_mesh(
    mut input: Input<'_>,
    path: &Path,
    scratch: &Path,
    options: &MeshOptions,
    observer: &mut dyn FnMut(MeshProgress) -> ControlFlow<()>,
) -> Result<MeshReport, MeshError> {
    let folder = Scratch::new(scratch);
    let mut options = options.clone();
    options.colours = match &mut input {
        Input::Pipe(source) => source.has_colours(),
        Input::File(open) => open().map_err(stream_decimate::Error::from)?.has_colours(),
    };
    let options = &options;
    let line = Line {
        path,
        scratch: &folder,
        options,
        plan: options.plan(),
        collapse_options: options.collapse_options(),
    };
    let mut start = Start { linker: None, collapsing: None, order: ReadOrder::AsIs };
    if let Some(keep) = &options.keep {
        if options.resume {
            if let Some(report) = line.finish_earlier(&mut input, keep, observer)? {
                return Ok(report);
            }
            if let Some(earlier) = line.earlier(keep)? {
                start = earlier;
            }
        }
        if start.linker.is_none() {
            // Without a checkpoint it is of no use.
            keep.remove(&folder)?;
        }
    }
    let resumed = start.linker.is_some();
    let built = line.build_in_orders(input, start, observer);
    let built = built.map_err(|error| match (&options.keep, error) {
        (Some(keep), MeshError::Collapse(stream_decimate::Error::OtherInput { .. })) => {
            keep.fail(&folder, StateProblem::Other).into()
        }
        (_, error) => error,
    });
    if let (Some(keep), Err(error)) = (&options.keep, &built)
        && error.is_of_the_mesh()
    {
        // It would be the same the next time.
        keep.remove(&folder)?;
    }
    Ok(MeshReport { resumed, ..built? })
}

impl MeshError {
    /// Whether the mesh itself is the reason.
    fn is_of_the_mesh(&self) -> bool {
        use stream_decimate::Error as Collapse;
        match self {
            Self::Empty | Self::Collapse(Collapse::Unsorted { .. }) => true,
            Self::Build(error) => matches!(error, Error::Record { .. } | Error::TooLarge { .. }),
            Self::Collapse(_) => false,
        }
    }
}

/// Where a run begins: what an earlier one has left, if anything.
struct Start {
    linker: Option<Linker>,
    collapsing: Option<Collapsing>,
    order: ReadOrder,
}

const ORDERS: [ReadOrder; 3] = [ReadOrder::AsIs, ReadOrder::Counted, ReadOrder::Sorted];

/// The order of this number, as it stands in a checkpoint.
fn order_of(number: u64) -> Result<ReadOrder, CheckpointError> {
    let order = usize::try_from(number).ok().and_then(|number| ORDERS.get(number));
    order.copied().ok_or(CheckpointError::Damaged("order"))
}

struct Line<'a> {
    path: &'a Path,
    scratch: &'a Scratch,
    options: &'a MeshOptions,
    plan: MemoryPlan,
    collapse_options: CollapseOptions,
}

impl Line<'_> {
    fn link_options(&self) -> LinkOptions {
        let mut link = LinkOptions::new(names(&self.collapse_options));
        link.colours = self.options.colours;
        link.memory_bytes = self.plan.link_bytes.max(link.least_memory_bytes());
        link.write = self.options.write.clone();
        link
    }

    fn number_options(&self) -> NumberOptions {
        NumberOptions { memory_bytes: self.plan.number_bytes }
    }

    /// Numbers and writes what an earlier run has linked, if it came so far.
    fn finish_earlier(
        &self,
        input: &mut Input<'_>,
        keep: &Keep,
        observer: &mut dyn FnMut(MeshProgress) -> ControlFlow<()>,
    ) -> Result<Option<MeshReport>, MeshError> {
        let linked = Linked::resume(self.scratch, keep, &self.options.write)?;
        let Some(linked) = linked else { return Ok(None) };
        let fail = |problem: StateProblem| MeshError::from(keep.fail(self.scratch, problem));
        let notes: [u64; NOTES] = bytemuck::try_pod_read_unaligned(&linked.notes)
            .map_err(|_| fail(StateProblem::Damaged("notes")))?;
        let [order, report @ ..] = notes;
        let order = order_of(order).map_err(|error| fail(error.into()))?;
        let collapse = CollapseReport::from_words(report);
        if let Input::Pipe(source) = input {
            let mut told = |progress: &_| observer(MeshProgress::Collapse(*progress));
            check_input(*source, &collapse, &mut told).map_err(|error| match error {
                stream_decimate::Error::OtherInput { .. } => fail(StateProblem::Other),
                error => error.into(),
            })?;
        }
        let mut told = |progress: Progress| observer(MeshProgress::Build(progress));
        let built = finish(linked, self.path, &self.number_options(), &mut told)?;
        Ok(Some(MeshReport { built, collapse, mode: self.plan.mode, order, resumed: true }))
    }

    /// What an earlier run has left that had not come so far.
    fn earlier(&self, keep: &Keep) -> Result<Option<Start>, MeshError> {
        let Some((linker, mut reader)) = Linker::resume(self.scratch, &self.link_options(), keep)?
        else {
            return Ok(None);
        };
        let fail = |error: CheckpointError| MeshError::from(keep.fail(self.scratch, error));
        let order = reader.take_one::<u64>("order").and_then(order_of).map_err(fail)?;
        let collapsing = match Collapsing::resume(&self.collapse_options, &mut reader) {
            Err(stream_decimate::Error::Checkpoint(error)) => return Err(fail(error)),
            collapsing => collapsing?,
        };
        reader.finish().map_err(fail)?;
        if collapsing.num_told() != linker.num_nodes() {
            return Err(fail(CheckpointError::Damaged("collapses")));
        }
        Ok(Some(Start { linker: Some(linker), collapsing: Some(collapsing), order }))
    }

    /// Builds in one order after the other, until one of them will do.
    fn build_in_orders(
        &self,
        mut input: Input<'_>,
        mut start: Start,
        observer: &mut dyn FnMut(MeshProgress) -> ControlFlow<()>,
    ) -> Result<MeshReport, MeshError> {
        let is_there = |order| order != ReadOrder::Counted;
        let orders: Vec<ReadOrder> = match &mut input {
            Input::Pipe(_) => vec![ReadOrder::AsIs],
            Input::File(open) => {
                let numbered = open().map_err(stream_decimate::Error::from)?.has_vertex_numbers();
                ORDERS.into_iter().filter(|&order| numbered || is_there(order)).collect()
            }
        };
        loop {
            let order = start.order;
            let collapsing = match start.collapsing.take() {
                Some(collapsing) => collapsing,
                None => Collapsing::new(&self.collapse_options)?,
            };
            let linker = start.linker.take();
            let built = match &mut input {
                Input::Pipe(source) => self.build(linker, order, observer, |record, observer| {
                    collapsing.run(&mut **source, record, observer)
                }),
                Input::File(open) => self.build(linker, order, observer, |record, observer| {
                    let at = (order, self.scratch.folder());
                    collapsing.run_file(&mut **open, at, record, observer)
                }),
            };
            let is_unsorted =
                matches!(built, Err(MeshError::Collapse(stream_decimate::Error::Unsorted { .. })));
            match orders.iter().find(|&&next| next as u8 > order as u8) {
                Some(&next) if is_unsorted => start.order = next,
                _ => return built,
            }
            if let Some(keep) = &self.options.keep {
                keep.remove(self.scratch)?;
            }
        }
    }

    fn build(
        &self,
        linker: Option<Linker>,
        order: ReadOrder,
        observer: &mut dyn FnMut(MeshProgress) -> ControlFlow<()>,
        collapse: impl FnOnce(
            &mut dyn Recorder<MeshError>,
            &mut stream_decimate::Observer<'_>,
        ) -> Result<(CollapsedMesh, CollapseReport), MeshError>,
    ) -> Result<MeshReport, MeshError> {
        let observer = std::cell::RefCell::new(observer);
        let mut collapsed = CollapseReport::default();
        let feed = |feed: &mut Feed| -> Result<CoarseMesh, MeshError> {
            let pace = self.options.keep.is_some().then(|| {
                let pace = Pace::new(self.options.checkpoint_every);
                (pace, plan::checkpoint_bytes(names(&self.collapse_options)))
            });
            let mut record = Record { feed, pace, order };
            let mut told = |progress: &stream_decimate::Progress| {
                (observer.borrow_mut())(MeshProgress::Collapse(*progress))
            };
            let (rest, report) = collapse(&mut record, &mut told)?;
            collapsed = report;
            if rest.faces.is_empty() {
                return Err(MeshError::Empty);
            }
            let mut notes = [order as u64; NOTES];
            notes[1..].copy_from_slice(&report.to_words());
            feed.set_notes(bytemuck::bytes_of(&notes));
            Ok(coarse_mesh(&rest))
        };
        let mut told = |progress: Progress| (observer.borrow_mut())(MeshProgress::Build(progress));
        let number = self.number_options();
        let built = match linker {
            Some(linker) => go_on_from(feed, linker, self.path, &number, &mut told)?,
            None => {
                let mut options = BuildOptions::new(self.link_options());
                options.number = number;
                options.expected_nodes = self.options.expected_triangles.map(|count| count / 2);
                options.keep = self.options.keep.clone();
                options.checkpoint_bytes = self.collapse_options.checkpoint_bytes();
                build_from(feed, self.path, self.scratch, &options, &mut told)?
            }
        };
        let mode = self.plan.mode;
        Ok(MeshReport { built, collapse: collapsed, mode, order, resumed: false })
    }
}

/// Numbers of the notes: the order, and the report.
const NOTES: usize = 12;

/// Hands collapses on to the linker, and has checkpoints made.
struct Record<'a> {
    feed: &'a mut Feed,
    /// Where checkpoints are kept, and what the linker's part takes at most.
    pace: Option<(Pace, u64)>,
    order: ReadOrder,
}

impl Recorder<MeshError> for Record<'_> {
    fn tell(&mut self, collapse: &Collapsed) -> Result<(), MeshError> {
        let (record, normal) = record_of(collapse);
        Ok(self.feed.push_with(&record, collapse.position, normal, collapse.colour)?)
    }

    fn wants_checkpoint(&mut self, bytes: u64) -> bool {
        self.pace.as_ref().is_some_and(|(pace, linker)| pace.is_due(bytes + linker))
    }

    fn checkpoint(&mut self, state: &CollapseState<'_>) -> Result<(), MeshError> {
        let (start, mut bytes) = (Instant::now(), 0);
        self.feed.checkpoint(|out| -> Result<(), Error> {
            out.put("order", &[self.order as u64])?;
            state.save(out)?;
            bytes = out.bytes();
            Ok(())
        })?;
        if let Some((pace, _)) = &mut self.pace {
            pace.made(bytes, start.elapsed());
        }
        Ok(())
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
