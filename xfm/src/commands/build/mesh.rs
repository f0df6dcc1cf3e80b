//! From the mesh to the file, in core or through a buffer.

use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::UNIX_EPOCH;

use glam::Vec3;
use mesh_io::TriangleSource;
use scratch::Scratch;
use xfm_build::{
    BuildOptions, Keep, LinkOptions, MeshError, MeshProgress, NameBounds, Stage, build_mesh,
};
use xfm_format::{Encoding, PositionError, WriteOptions};

use super::plan::{Mode, Plan};
use super::report::{Built, Stages};
use crate::mesh_stream::Input;
use crate::progress::{Progress, Unit};
use crate::repaired::Repaired;
use crate::{Error, interrupt};

/// Triangles looked at at once.
const BATCH: usize = 1 << 14;
/// What a kept log is named, before its extension.
const KEPT: &str = "xfm-build";

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
    /// Whether the log is kept for a later run, and that of an earlier run gone on with.
    pub resume: bool,
}

/// Goes on where an earlier run ended, if that is wanted and there is one; begins otherwise.
///
/// # Errors
///
/// An input that cannot be read or has nothing in it; no room for scratch files; an output that cannot be written.
pub fn build(request: &Request<'_>, plan: &Plan) -> Result<Built, Error> {
    if request.resume
        && let Some(built) = resume(request, plan)?
    {
        return Ok(built);
    }
    let mut options = plan.options();
    options.keep = request.resume.then(|| keep(request));
    options.threads = request.threads;
    options.colour_weight = request.colour_weight;
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
        MeshError::Build(error) => error.into(),
        MeshError::Collapse(error) => failed(input, plan, error),
        error => Error::BuildMesh(error),
    })?;
    let repaired = report.collapse.repaired.counts().into();
    Ok(built_of(&report.built, plan.mode, repaired, report.collapse.input_triangles))
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

fn built_of(
    report: &xfm_build::BuildReport,
    mode: Mode,
    repaired: Repaired,
    input_triangles: u64,
) -> Built {
    Built {
        mode,
        input_triangles,
        nodes: report.nodes,
        base_triangles: report.base_triangles,
        repaired,
        written: report.written,
        scratch_bytes: report.scratch_bytes,
        stages: Stages {
            collapse: report.collapse,
            number: report.number,
            write: report.write,
            ..Stages::default()
        },
        resumed: false,
    }
}

fn resume(request: &Request<'_>, plan: &Plan) -> Result<Option<Built>, Error> {
    // What was linked knows its names; there is nothing left to link.
    let names = NameBounds { vertices: 0, faces: 0 };
    let mut options = BuildOptions::new(LinkOptions::new(names));
    options.link.write = super::in_frame(&request.write, request.input.open()?.frame());
    if request.write.encoding == Encoding::Compact {
        options.link.write.position_error = position_error(request)?;
    }
    options.number.memory_bytes = plan.options().plan().number_bytes;
    options.keep = Some(keep(request));
    let mut bars = Bars::default();
    let scratch = Scratch::new(&plan.scratch);
    let resumed = xfm_build::resume(request.output, &scratch, &options, &mut |done| {
        bars.show(MeshProgress::Build(done), plan.expected_triangles)
    })?;
    Ok(resumed.map(|report| Built {
        resumed: true,
        ..built_of(&report, Mode::Streaming, Repaired::new(), report.input_triangles)
    }))
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

/// What a run has to have in common with one that it goes on with: input, options, version.
fn keep(request: &Request<'_>) -> Keep {
    let (length, seconds) = request.path.metadata().map_or((0, 0), |metadata| {
        let written =
            metadata.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        (metadata.len(), written.map_or(0, |time| time.as_nanos()))
    });
    let name = request.path.canonicalize().unwrap_or_else(|_| request.path.to_owned());
    let identity = format!(
        "{}\n{length}\n{seconds}\n{:?}\n{}\n{}",
        name.display(),
        request.write,
        request.colour_weight,
        env!("CARGO_PKG_VERSION")
    );
    Keep { name: KEPT.to_owned(), identity: identity.into_bytes() }
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
