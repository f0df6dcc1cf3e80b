//! `xfm decimate`: fewer triangles.

mod bar;

use std::fmt;
use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::ValueEnum;
use mesh_io::{Format, Frame, IndexedMesh};
use serde::Serialize;
use stream_decimate::{
    DecimateOptions, DecimateReport, Target, decimate, decimate_clustered, decimate_file,
    decimate_greedy,
};

use self::bar::Bar;
use crate::memory::peak_rss;
use crate::mesh_file::read_mesh_in_frame;
use crate::mesh_stream::{Input, Kept, Output, scratch_folder};
use crate::repaired::{self, Repaired};
use crate::report::{ReportTo, say};
use crate::threads::with_threads;
use crate::{Error, interrupt, text, values};

/// Memory that the buffer takes for each of its triangles, about.
const BUFFER_BYTES: usize = 128;

/// Decimate a mesh of any size in fixed memory
///
/// The default method reads the mesh once, holds a part of it in a buffer, and writes the result as it goes; memory depends
/// on the buffer, not on the mesh. The number of triangles is met exactly unless the topology or the boundary
/// forbids it, which is then said; what is closed stays closed. Coordinates stay in the input's frame. Colours are left out:
/// `xfm build` and `xfm extract` keep them.
#[derive(Debug, Clone, clap::Args)]
#[command(group = clap::ArgGroup::new("target").required(true).args(["ratio", "faces", "max_error"]))]
#[command(after_help = "\
Examples:
  To a fiftieth
    xfm decimate dragon.ply dragon-small.ply --ratio 0.02

  As far as the surface moves by no more than 0.05 units
    xfm decimate scan.obj.gz scan.glb --max-error 0.05

  Between two other programs, with a larger buffer
    generate-mesh | xfm decimate - - --from stl --to obj --ratio 0.01 --buffer 2000000 | view-mesh

  The best there is, in memory; and the fastest, which asks nothing about the topology
    xfm decimate dragon.ply best.ply --faces 20000 --method greedy
    xfm decimate dragon.ply rough.ply --faces 20000 --method cluster")]
pub struct DecimateArgs {
    /// The mesh (.stl, .ply, .obj, .gltf, .glb, each also as .gz or .zst); - is standard input
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// The mesh to write, which may be the input; - is standard output
    #[arg(value_name = "OUT")]
    output: PathBuf,
    /// To this share of the triangles, above 0 and up to 1
    #[arg(long, value_name = "P", value_parser = values::share)]
    ratio: Option<f64>,
    /// To so many triangles
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    faces: Option<u64>,
    /// As far as the surface moves by no more than this distance, in model units
    #[arg(long, value_name = "E", value_parser = values::distance)]
    max_error: Option<f64>,
    /// Triangles the buffer holds at most, 64 or more
    #[arg(long, value_name = "N", default_value = "400000", value_parser = values::buffer)]
    buffer: usize,
    /// Collapses to choose among, 1 to 64: more is better and slower
    #[arg(long, value_name = "N", default_value = "8", value_parser = clap::value_parser!(u8).range(1..=64))]
    candidates: u8,
    /// Seed of the random choices
    #[arg(long, value_name = "N", default_value = "0")]
    seed: u64,
    /// How to decimate
    #[arg(long, value_enum, default_value = "stream")]
    method: Method,
    /// Format of the input where its name does not tell: stl, ply, obj, gltf, glb
    #[arg(long, value_name = "FMT", value_parser = values::format)]
    from: Option<Format>,
    /// Format of the output where its name does not tell: stl, stla, ply, plya, plyb, obj, gltf, glb. Default of a pipe: ply
    #[arg(long, value_name = "FMT", value_parser = values::format)]
    to: Option<Format>,
    /// Worker threads [default: one for each core]; the result does not depend on them
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// Folder for scratch files [default: that of the output, or the system's]
    #[arg(long, value_name = "DIR")]
    scratch: Option<PathBuf>,
    /// Report as JSON on standard output, or on standard error if that carries the mesh
    #[arg(long)]
    json: bool,
}

/// The methods by the names the command line has for them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
enum Method {
    /// In one pass through a buffer (Wu and Kobbelt 2003)
    Stream,
    /// In memory, the cheapest collapse of the whole mesh first (Garland and Heckbert 1997)
    Greedy,
    /// By clusters of vertices in a grid, about so many triangles (Lindstrom 2000)
    Cluster,
}

/// What `xfm decimate` reports; times in seconds, sizes in bytes.
#[derive(Debug, Clone, Serialize)]
struct Report {
    method: Method,
    input_triangles: u64,
    output_triangles: u64,
    target_triangles: Option<u64>,
    seconds: f64,
    triangles_per_second: f64,
    peak_rss: Option<u64>,
    buffer_triangles: u64,
    peak_buffer_triangles: u64,
    missed: Option<Repaired>,
    repaired: Repaired,
    counted: bool,
    sorted: bool,
    sealed_vertices: u64,
    warnings: Vec<String>,
    /// The counts in words, as in `asked 500, got 512: boundary 9`.
    #[serde(skip)]
    outcome: String,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} of {} triangles in {}, {} per second",
            text::count(self.output_triangles),
            text::count(self.input_triangles),
            text::seconds(self.seconds),
            text::count(self.triangles_per_second as u64),
        )?;
        if let Some(peak) = self.peak_rss {
            write!(f, ", peak memory {}", text::size(peak))?;
        }
        if self.missed.is_some() {
            write!(f, "\n{}", self.outcome)?;
        }
        if let Some(repaired) = repaired::words(&self.repaired) {
            write!(f, "\nrepaired: {repaired}")?;
        }
        if self.sorted {
            write!(f, "\nthe triangles were sorted along the longest axis first")?;
        } else if self.counted && self.method == Method::Stream {
            write!(f, "\nthe file was read once more, to learn where its boundaries are")?;
        }
        if self.sealed_vertices > 0 {
            let count = text::count(self.sealed_vertices);
            write!(f, "\n{count} vertices were taken for true boundary, having waited longest")?;
        }
        Ok(())
    }
}

impl DecimateArgs {
    fn options(&self) -> DecimateOptions {
        let target = match (self.ratio, self.faces, self.max_error) {
            (Some(ratio), ..) => Target::Ratio(ratio),
            (_, Some(faces), _) => Target::Triangles(faces),
            (.., error) => Target::MaxError(error.unwrap_or(0.0)),
        };
        let mut options = DecimateOptions::new(target);
        options.buffer_triangles = self.buffer;
        options.candidates = usize::from(self.candidates);
        options.seed = self.seed;
        options.threads = self.threads;
        options
    }

    /// Options with a buffer that the system has room for: where it has not, that is told rather than died of.
    fn stream_options(&self) -> Result<DecimateOptions, Error> {
        let mut room = Vec::<u8>::new();
        match self.buffer.checked_mul(BUFFER_BYTES).map(|bytes| room.try_reserve_exact(bytes)) {
            Some(Ok(())) => Ok(self.options()),
            _ => Err(Error::BufferTooLarge { triangles: self.buffer }),
        }
    }

    fn scratch(&self, output: &Output) -> Result<PathBuf, Error> {
        scratch_folder(self.scratch.as_deref(), || output.scratch_folder())
    }
}

/// Runs the command.
///
/// # Errors
///
/// An input that cannot be read, or is in an order that cannot be followed; an output that cannot be written; an
/// interruption.
pub fn run(args: &DecimateArgs) -> Result<(), Error> {
    let start = Instant::now();
    let input = Input::new(&args.input, args.from);
    let output = Output::new(&args.output, args.to)?;
    let scratch = args.scratch(&output)?;
    let done = with_threads(args.threads, || match args.method {
        Method::Stream if input.is_file() => stream_file(args, &input, &output, &scratch),
        Method::Stream => stream_pipe(args, &input, &output),
        Method::Greedy => greedy(args, &input, &output),
        Method::Cluster => cluster(args, &input, &output, &scratch),
    });
    let done = match done {
        // Who read the output has seen what they wanted.
        Err(_) if output.has_no_reader() && !interrupt::is_requested() => return Ok(()),
        // The output's format was known before.
        Err(Error::Mesh(mesh_io::Error::UnknownFormat { .. })) if input.is_pipe() => {
            return Err(Error::NoFormat);
        }
        done => done?,
    };
    let warnings = done.warnings(args, &output);
    let report_to = match (args.json, output.is_pipe()) {
        (true, true) => ReportTo::ScriptsBesideMesh,
        (json, _) => ReportTo::new(json),
    };
    // Not into the middle of the JSON, which has them too.
    if report_to != ReportTo::ScriptsBesideMesh {
        warnings.iter().for_each(|warning| say(&format!("warning: {warning}")));
    }
    let seconds = start.elapsed().as_secs_f64();
    let report = done.report;
    let outcome = report.to_string();
    let report = Report {
        method: args.method,
        input_triangles: report.input_triangles,
        output_triangles: report.output_triangles,
        target_triangles: report.target_triangles,
        seconds,
        triangles_per_second: report.input_triangles as f64 / seconds,
        peak_rss: peak_rss(),
        buffer_triangles: match args.method {
            Method::Stream => args.buffer as u64,
            _ => report.peak_buffer_triangles,
        },
        peak_buffer_triangles: report.peak_buffer_triangles,
        missed: report.missed.map(|missed| missed.counts().into()),
        repaired: report.repaired.counts().into(),
        counted: report.counted,
        sorted: report.sorted,
        sealed_vertices: report.sealed_vertices,
        warnings,
        outcome,
    };
    report_to.deliver(&report)
}

/// What came of a run.
struct Done {
    report: DecimateReport,
    frame: Frame,
    /// Whether the input has colours, which no method carries.
    colours_lost: bool,
}

impl Done {
    fn warnings(&self, args: &DecimateArgs, output: &Output) -> Vec<String> {
        let step = output.step(self.frame);
        let mut warnings = Vec::new();
        if let Some(most) = args.max_error.filter(|&most| step > most) {
            warnings.push(format!(
                "{}: its coordinates are rounded to steps of {}, more than the largest error asked for, {}; move the mesh nearer to its origin",
                output.name(),
                text::number(step, 3),
                text::number(most, 3)
            ));
        }
        warnings.extend(output.rounding(self.frame));
        if self.colours_lost {
            warnings.push(format!(
                "{}: the colours are left out; xfm build and xfm extract keep them",
                output.name()
            ));
        }
        warnings
    }
}

/// Turns the library's error into the command's, which names the input.
fn failed(input: &Input) -> impl Fn(stream_decimate::Error) -> Error {
    let (name, is_file) = (input.name(), input.is_file());
    move |error| match error {
        stream_decimate::Error::Mesh(error) => error.into(),
        stream_decimate::Error::Interrupted => Error::Interrupted,
        // Of a file, that was the last attempt: it has been sorted.
        stream_decimate::Error::Unsorted { waiting, buffer, .. } if is_file => {
            Error::BufferTooSmall { name: name.clone(), waiting, buffer }
        }
        source => Error::Decimate { name: name.clone(), source },
    }
}

fn stream_file(
    args: &DecimateArgs,
    input: &Input,
    output: &Output,
    scratch: &Path,
) -> Result<Done, Error> {
    let options = args.stream_options()?;
    let mut bar = Bar::default();
    let mut observer = |progress: &stream_decimate::Progress| {
        bar.show_stream(progress);
        go_on(output)
    };
    let mut frame = Frame::default();
    let mut create = |of_input: Frame| {
        frame = of_input;
        output.create_whole(frame, scratch)
    };
    let mut colours_lost = false;
    let mut open = || {
        let source = input.open()?;
        colours_lost = source.has_colours();
        Ok(source)
    };
    let report = decimate_file(&mut open, &mut create, &options, scratch, &mut observer)
        .map_err(failed(input))?;
    Ok(Done { report, frame, colours_lost })
}

fn stream_pipe(args: &DecimateArgs, input: &Input, output: &Output) -> Result<Done, Error> {
    let options = args.stream_options()?;
    let stream = || {
        let mut bar = Bar::default();
        let mut observer = |progress: &stream_decimate::Progress| {
            bar.show_stream(progress);
            go_on(output)
        };
        let mut source = input.open()?;
        let frame = source.frame();
        let mut sink = output.create(frame)?;
        let report =
            decimate(&mut *source, &mut *sink, &options, &mut observer).map_err(failed(input))?;
        sink.finish()?;
        Ok(Done { report, frame, colours_lost: source.has_colours() })
    };
    // From pipe to pipe nothing has a name that would be left behind, and nothing else breaks off the waiting for whoever
    // reads.
    if output.is_pipe() { interrupt::freely(stream) } else { stream() }
}

fn greedy(args: &DecimateArgs, input: &Input, output: &Output) -> Result<Done, Error> {
    let (mesh, frame) = read_mesh_in_frame(&args.input, args.from)?;
    let options = args.options();
    let target = options.target.triangles(mesh.triangles.len() as u64);
    let mut bar = Bar::default();
    let mut observer = |progress: &stream_decimate::Progress| {
        bar.show_greedy(progress, target.unwrap_or(0));
        go_on(output)
    };
    let (decimated, report) =
        decimate_greedy(&mesh, &options, &mut observer).map_err(failed(input))?;
    let colours_lost = !mesh.colours.is_empty();
    drop((mesh, bar));
    write(output, &decimated, frame)?;
    Ok(Done { report, frame, colours_lost })
}

fn cluster(
    args: &DecimateArgs,
    input: &Input,
    output: &Output,
    scratch: &Path,
) -> Result<Done, Error> {
    let mut kept = if input.is_file() { None } else { Some(input.keep(scratch)?) };
    let (mut frame, mut colours_lost) = (Frame::default(), false);
    let mut open = || {
        let source = kept.as_mut().map_or_else(|| input.open(), Kept::open)?;
        frame = source.frame();
        colours_lost = source.has_colours();
        Ok(source)
    };
    let mut bar = Bar::default();
    let mut observer = |progress: &stream_decimate::Progress| {
        bar.show_stream(progress);
        go_on(output)
    };
    let (decimated, report) =
        decimate_clustered(&mut open, &args.options(), &mut observer).map_err(failed(input))?;
    drop(bar);
    write(output, &decimated, frame)?;
    Ok(Done { report, frame, colours_lost })
}

fn write(output: &Output, mesh: &IndexedMesh, frame: Frame) -> Result<(), Error> {
    interrupt::check()?;
    let write = || Ok(output.write(&mut &*mesh, frame)?);
    if output.is_pipe() { interrupt::freely(write) } else { write() }
}

/// Whether there is still somebody who wants the result.
fn go_on(output: &Output) -> ControlFlow<()> {
    if interrupt::is_requested() || output.has_no_reader() {
        ControlFlow::Break(())
    } else {
        ControlFlow::Continue(())
    }
}
