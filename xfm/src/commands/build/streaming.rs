//! Through a buffer, in bounded memory: here so far what goes on with a run that had collapsed all.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::UNIX_EPOCH;

use scratch::Scratch;
use xfm_build::{BuildOptions, Keep, LinkOptions, NameBounds, Progress as Done, Stage};

use super::plan::{Mode, Plan};
use super::report::{Built, Stages};
use crate::mesh_stream::Input;
use crate::progress::{Progress, Unit};
use crate::repaired::Repaired;
use crate::{Error, interrupt};

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
    /// Size of blocks.
    pub levels: u32,
    /// Whether the log is kept for a later run, and that of an earlier run gone on with.
    pub resume: bool,
}

/// Goes on where an earlier run ended, if that is wanted and there is one; begins otherwise.
///
/// # Errors
///
/// An input that cannot be read or has nothing in it; no room for scratch files; an output that cannot be written.
pub fn build(request: &Request<'_>, plan: &Plan) -> Result<Built, Error> {
    match resume(request, plan)? {
        Some(built) => Ok(built),
        None => Err(Error::NoStreaming { name: request.input.name() }),
    }
}

fn resume(request: &Request<'_>, plan: &Plan) -> Result<Option<Built>, Error> {
    if !request.resume {
        return Ok(None);
    }
    // What was linked knows its names; there is nothing left to link.
    let names = NameBounds { vertices: 0, faces: 0 };
    let mut options = BuildOptions::new(LinkOptions::new(names));
    options.link.write = super::write_options(request.levels, request.input.open()?.frame());
    options.number.memory_bytes = plan.memory;
    options.keep = Some(keep(request));
    let mut bars = Bars::default();
    let scratch = Scratch::new(&plan.scratch);
    let resumed =
        xfm_build::resume(request.output, &scratch, &options, &mut |done| bars.show(done))?;
    Ok(resumed.map(|report| Built {
        mode: Mode::Streaming,
        input_triangles: report.input_triangles,
        nodes: report.nodes,
        base_triangles: report.base_triangles,
        repaired: Repaired::new(),
        written: report.written,
        scratch_bytes: report.scratch_bytes,
        stages: Stages {
            collapse: report.collapse,
            number: report.number,
            write: report.write,
            ..Stages::default()
        },
        resumed: true,
    }))
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
        "{}\n{length}\n{seconds}\n{}\n{}",
        name.display(),
        request.levels,
        env!("CARGO_PKG_VERSION")
    );
    Keep { name: KEPT.to_owned(), identity: identity.into_bytes() }
}

/// A bar for one stage after the other.
#[derive(Debug, Default)]
struct Bars(Option<(Stage, Progress)>);

impl Bars {
    /// Shows how far the build is; breaks off after Ctrl-C.
    fn show(&mut self, done: Done) -> ControlFlow<()> {
        if self.0.as_ref().is_none_or(|(stage, _)| *stage != done.stage) {
            let task = match done.stage {
                Stage::Number => "numbering",
                _ => "writing",
            };
            self.0 = Some((done.stage, Progress::new(task, Some(done.total), Unit::Items)));
        }
        if let Some((_, bar)) = &self.0 {
            bar.set(done.done);
        }
        if interrupt::is_requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}
