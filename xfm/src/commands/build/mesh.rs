//! From the mesh to the file, in core or through a buffer.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::{Duration, UNIX_EPOCH};

use glam::Vec3;
use mesh_io::TriangleSource;
use scratch::Scratch;
use xfm_build::{
    CoarseProblem, Keep, MeshError, MeshProgress, MeshReport, RecordProblem, Stage, build_mesh,
};
use xfm_format::{Encoding, PositionError, WriteOptions};

use super::plan::{Mode, Plan};
use super::report::{Built, Stages};
use crate::mesh_stream::Input;
use crate::progress::{Progress, Unit};
use crate::{Error, interrupt};

/// Triangles looked at at once.
const BATCH: usize = 1 << 14;

/// What is asked for.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// The mesh.
    pub input: &'a Input,
    /// Where it is.
    pub path: &'a Path,
    /// The file to write.
    pub output: &'a Path,
    /// How the file is written, whatever its frame.
    pub write: WriteOptions,
    /// How much colours count.
    pub colour_weight: f32,
    /// Threads to use at most.
    pub threads: Option<NonZeroUsize>,
    /// Whether to go on with what an earlier run has left.
    pub resume: bool,
    /// Time from one checkpoint to the next, where they are kept.
    pub checkpoint_every: Option<Duration>,
}

/// Goes on where an earlier run ended, if that is wanted and there is one; begins otherwise.
///
/// # Errors
///
/// An input that cannot be read or has nothing in it; no room for scratch files; an output that cannot be written; what an
/// earlier run has left and cannot be gone on with.
pub fn build(request: &Request<'_>, plan: &Plan) -> Result<Built, Error> {
    let mut options = plan.options();
    options.keep = plan.keeps.then(|| keep(request));
    options.resume = request.resume;
    options.checkpoint_every = request.checkpoint_every;
    options.threads = request.threads;
    options.colour_weight = request.colour_weight;
    let keep = options.keep.clone();
    let mut bars = Bars::default();
    let mut observer = |progress: MeshProgress| bars.show(progress, plan.expected_triangles);
    let input = request.input;
    let write = |frame| super::in_frame(&request.write, frame);
    let built = if input.is_file() {
        let mut open = || input.open();
        options.write = write(open()?.frame());
        if request.write.encoding == Encoding::Compact {
            options.write.position_error = position_error(request)?;
        }
        let input = xfm_build::Input::File(&mut open);
        build_mesh(input, request.output, &plan.scratch, &options, &mut observer)
    } else {
        if request.write.encoding == Encoding::Compact
            && let PositionError::OfDiagonal(_) = request.write.position_error
        {
            return Err(Error::ShareOfPipe { name: input.name() });
        }
        let mut source = input.open()?;
        options.write = write(source.frame());
        let input = xfm_build::Input::Pipe(&mut *source);
        build_mesh(input, request.output, &plan.scratch, &options, &mut observer)
    };
    let report = built.map_err(|error| match error {
        MeshError::Empty => Error::NothingToBuild { file: request.path.to_owned() },
        MeshError::Build(xfm_build::Error::Interrupted) => Error::Interrupted,
        MeshError::Build(error @ xfm_build::Error::State { .. }) => Error::Resume { source: error },
        MeshError::Build(error) if is_about_grid(&error) => {
            Error::Grid { file: request.path.to_owned(), source: error }
        }
        MeshError::Build(error) => error.into(),
        MeshError::Collapse(error) => failed(input, plan, error),
        error => Error::BuildMesh(error),
    });
    let report = report.map_err(|error| match (error, &keep) {
        (Error::Interrupted, Some(keep)) if keep.is_there(&Scratch::new(&plan.scratch)) => {
            Error::InterruptedKept { folder: plan.scratch.clone() }
        }
        (error, _) => error,
    })?;
    Ok(built_of(&report, plan.mode))
}

/// Whether another error for positions would do.
fn is_about_grid(error: &xfm_build::Error) -> bool {
    matches!(
        error,
        xfm_build::Error::Format(xfm_format::Error::PositionError { .. })
            | xfm_build::Error::Coarse(CoarseProblem::TooFar)
            | xfm_build::Error::Record { problem: RecordProblem::TooFar, .. }
    )
}

/// What went wrong with the triangles, with the input's name and what can be done about it.
fn failed(input: &Input, plan: &Plan, error: stream_decimate::Error) -> Error {
    match error {
        stream_decimate::Error::Mesh(error) => error.into(),
        stream_decimate::Error::Interrupted => Error::Interrupted,
        stream_decimate::Error::Unsorted { waiting, buffer, .. } => Error::MemoryTooSmallForOrder {
            name: input.name(),
            waiting,
            buffer,
            memory: plan.memory,
        },
        source => Error::Decimate { name: input.name(), source },
    }
}

fn built_of(report: &MeshReport, mode: Mode) -> Built {
    let MeshReport { built, collapse, resumed, .. } = report;
    Built {
        mode,
        input_triangles: collapse.input_triangles,
        nodes: built.nodes,
        base_triangles: built.base_triangles,
        repaired: collapse.repaired.counts().into(),
        written: built.written,
        scratch_bytes: built.scratch_bytes,
        stages: Stages {
            collapse: built.collapse,
            number: built.number,
            write: built.write,
            ..Stages::default()
        },
        resumed: *resumed,
    }
}

/// The error allowed for positions in model units; a share of the bounding box takes one more pass over the file.
fn position_error(request: &Request<'_>) -> Result<PositionError, Error> {
    let error = request.write.position_error;
    let PositionError::OfDiagonal(_) = error else { return Ok(error) };
    let mut source = request.input.open()?;
    let mut triangles = Vec::new();
    let mut bounds = [Vec3::INFINITY, Vec3::NEG_INFINITY];
    while source.read(&mut triangles, BATCH)? > 0 {
        for p in triangles.drain(..).flatten().filter(|p| p.is_finite()) {
            bounds = [bounds[0].min(p), bounds[1].max(p)];
        }
        interrupt::check()?;
    }
    // Of nothing at all the build says that it is nothing.
    Ok(error.in_units(if bounds[0].is_finite() { bounds } else { [Vec3::ZERO; 2] }))
}

/// What a run has to have in common with one that it goes on with: input, options, version. What comes through a pipe is
/// compared when it comes.
fn keep(request: &Request<'_>) -> Keep {
    let input = if request.input.is_file() {
        let (length, time) = request.path.metadata().map_or((0, 0), |metadata| {
            let written =
                metadata.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
            (metadata.len(), written.map_or(0, |time| time.as_nanos()))
        });
        let name = request.path.canonicalize().unwrap_or_else(|_| request.path.to_owned());
        format!("{}\n{length}\n{time}", name.display())
    } else {
        "a pipe".to_owned()
    };
    let (write, version) = (&request.write, env!("CARGO_PKG_VERSION"));
    let colours = request.colour_weight;
    let identity = format!("{input}\n{write:?}\n{colours}\n{version}");
    Keep { name: kept_name(request.output), identity: identity.into_bytes() }
}

/// What begins the names of files that are kept: that of the output, and a number that is another for one of the same name
/// in another folder.
fn kept_name(output: &Path) -> String {
    let path = std::path::absolute(output).unwrap_or_else(|_| output.to_owned());
    let path = match (path.parent().map(Path::canonicalize), path.file_name()) {
        (Some(Ok(folder)), Some(name)) => folder.join(name),
        _ => path,
    };
    let name = output.file_name().unwrap_or_default().to_string_lossy().into_owned();
    format!("{name}-{:08x}", crc32fast::hash(path.as_os_str().as_encoded_bytes()))
}

/// A bar for one stage after the other.
#[derive(Default)]
struct Bars(Option<(&'static str, Progress)>);

impl Bars {
    /// Shows how far the build is; breaks off after Ctrl-C.
    fn show(&mut self, progress: MeshProgress, expected: Option<u64>) -> ControlFlow<()> {
        use stream_decimate::Stage as Reading;
        let (task, done, total) = match progress {
            MeshProgress::Collapse(at) => match at.stage {
                Reading::Counting => ("counting", at.read, at.expected.or(expected)),
                Reading::Sorting => ("sorting", at.read, at.expected.or(expected)),
                Reading::Skipping => ("skipping", at.read, at.expected.or(expected)),
                _ => ("collapsing", at.read, at.expected.or(expected)),
            },
            MeshProgress::Build(at) => match at.stage {
                Stage::Number => ("numbering", at.done, Some(at.total)),
                _ => ("writing", at.done, Some(at.total)),
            },
            _ => return ControlFlow::Continue(()),
        };
        if self.0.as_ref().is_none_or(|shown| shown.0 != task) {
            // The old one goes before the new one comes.
            self.0 = None;
            self.0 = Some((task, Progress::new(task, total, Unit::Items)));
        }
        if let Some((_, bar)) = &self.0 {
            bar.set(done);
            if let MeshProgress::Collapse(at) = progress
                && task == "collapsing"
                && at.capacity > 0
            {
                let filled = 100 * at.buffered / at.capacity;
                let level = 100.0 * at.resolution;
                bar.describe(format!("collapsing (buffer {filled} %, resolution {level:.2} %)"));
            }
        }
        if interrupt::is_requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}
