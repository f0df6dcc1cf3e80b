//! `xfm build`: from a mesh to a `.xfm` file.

mod mesh;
mod plan;
mod report;

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::ValueEnum;
use mesh_io::{Format, Frame};
use xfm_format::{Encoding, PositionError, Precision, WriteOptions};

use crate::memory::AnonymousPeak;
use crate::mesh_stream::{Input, scratch_beside, scratch_folder};
use crate::report::ReportTo;
use crate::threads::with_threads;
use crate::{Error, values, writable};
use plan::{Mode, Plan};
use report::{BuildReport, Built};

/// Build a view-dependent .xfm file from a mesh
///
/// The input is welded and repaired into a manifold first; what that took is reported. Positions are kept bit for bit unless --encoding
/// compact is asked for, those far from zero about an origin near them, so that they keep their digits. The file appears whole or not at all, and is the same,
/// byte for byte, for any number of threads.
///
/// What fits --memory is built in core, anything else streaming, through scratch files. Nothing of these is left behind, however the run
/// ends, unless --scratch names a folder for them: then a checkpoint is kept there until the file is whole, and the same command with
/// --resume goes on from it, to the same file. Input, options and every byte that was kept are checked first.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
Examples:
  Build, then look at what came out
    xfm build dragon.ply dragon.xfm
    xfm info dragon.xfm

  From a pipe, with more memory allowed
    gunzip -c scan.stl.gz | xfm build - scan.xfm --memory 8GiB

  A quarter of the size, vertices moved by no more than a ten-thousandth of the whole
    xfm build dragon.ply dragon.xfm --encoding compact --position-error 1e-4

  Hours of work that may be broken off, and gone on with by the same command
    xfm build huge.ply huge.xfm --scratch /data/tmp --resume

  Check that nothing was lost
    xfm build horse.obj horse.xfm && xfm verify horse.xfm --against horse.obj")]
pub struct BuildArgs {
    /// The mesh (.stl, .ply, .obj, .gltf, .glb, each also as .gz or .zst); - is standard input
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// The file to write
    #[arg(value_name = "OUT.xfm")]
    output: PathBuf,
    /// Anonymous memory that may be used at most, like 512MiB or 4G
    #[arg(long, value_name = "SIZE", default_value = "1GiB", value_parser = values::size)]
    memory: u64,
    /// Size of blocks: up to 2^N - 1 nodes, as many as a tree of N levels has; 1 to 5
    #[arg(long, value_name = "N", default_value = "4", value_parser = clap::value_parser!(u32).range(1..=5))]
    levels: u32,
    /// How numbers are stored
    #[arg(long, value_enum, default_value = "exact")]
    encoding: EncodingArg,
    /// How far compact may move vertices: a share of the bounding box's diagonal, or in model units with a u, like 0.05u
    #[arg(long, value_name = "SHARE", default_value = "2e-4", value_parser = values::position_error)]
    position_error: PositionError,
    /// How much colours of vertices count: one wrong by all of a component as much as a surface wrong by this share of the
    /// bounding box's diagonal; 0 is not at all
    #[arg(long, value_name = "W", default_value = "0.002", value_parser = values::weight)]
    colour_weight: f32,
    /// Format of the input where its name does not tell: stl, ply, obj, gltf, glb
    #[arg(long, value_name = "FMT", value_parser = values::format)]
    from: Option<Format>,
    /// Folder for scratch files [default: that of the output]; a run that is broken off leaves there what --resume goes on from
    #[arg(long, value_name = "DIR")]
    scratch: Option<PathBuf>,
    /// Build with the whole mesh in memory, whatever its size is thought to be
    #[arg(long, conflicts_with = "streaming")]
    in_core: bool,
    /// Build through scratch files, even where the mesh would fit into memory
    #[arg(long)]
    streaming: bool,
    /// Go on with what an earlier run that was broken off has left in the scratch folder, however it ended; begin where there is nothing
    #[arg(long, requires = "scratch")]
    resume: bool,
    /// Time from one checkpoint in the scratch folder to the next [default: so that they take a fiftieth of the time]
    #[arg(long, value_name = "SECONDS", requires = "scratch", value_parser = values::seconds)]
    checkpoint_every: Option<Duration>,
    /// Worker threads [default: one for each core]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// Report as JSON on standard output
    #[arg(long)]
    json: bool,
}

/// The encodings by the names the command line has for them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum EncodingArg {
    /// Positions bit-identical to the input
    Exact,
    /// Rounded within --position-error, a quarter of the size
    Compact,
}

/// Runs the command.
///
/// # Errors
///
/// An input that cannot be read, has nothing in it, or is too large for the memory; an output that cannot be written.
pub fn run(args: &BuildArgs) -> Result<(), Error> {
    let start = Instant::now();
    check_output(&args.output)?;
    let input = Input::new(&args.input, args.from);
    let plan = args.plan(&input)?;
    plan.check_memory(&args.input)?;
    plan.check_room(&args.output)?;
    let peak = AnonymousPeak::watch();
    let built = with_threads(args.threads, || build(args, &input, &plan))?;
    let report = BuildReport::new(built, &plan, start.elapsed(), &peak);
    ReportTo::new(args.json).deliver(&report)
}

impl BuildArgs {
    fn write_options(&self) -> WriteOptions {
        let mut options = WriteOptions::default();
        options.levels = self.levels;
        options.encoding = match self.encoding {
            EncodingArg::Exact => Encoding::Exact,
            EncodingArg::Compact => Encoding::Compact,
        };
        options.position_error = self.position_error;
        options
    }

    fn plan(&self, input: &Input) -> Result<Plan, Error> {
        let forced = match (self.in_core, self.streaming) {
            (true, _) => Some(Mode::InCore),
            (_, true) => Some(Mode::Streaming),
            _ => None,
        };
        let expected = plan::expected_triangles(input, &self.input)?;
        let scratch = scratch_folder(self.scratch.as_deref(), || scratch_beside(&self.output))?;
        let colours = input.is_file() && input.open()?.has_colours();
        let plan = Plan::new(expected, self.memory, forced, scratch);
        let mut plan = plan.with_colours(colours, forced);
        plan.keeps = self.scratch.is_some();
        Ok(plan)
    }
}

fn build(args: &BuildArgs, input: &Input, plan: &Plan) -> Result<Built, Error> {
    let (path, output, write) = (&args.input, &args.output, args.write_options());
    let request = mesh::Request {
        input,
        path,
        output,
        write,
        colour_weight: args.colour_weight,
        threads: args.threads,
        resume: args.resume,
        checkpoint_every: args.checkpoint_every,
    };
    mesh::build(&request, plan)
}

/// How a file of a mesh in this frame is written.
fn in_frame(options: &WriteOptions, frame: Frame) -> WriteOptions {
    let mut options = options.clone();
    options.origin = frame.origin;
    options.precision = if frame.double { Precision::Double } else { Precision::Single };
    options
}

/// Before the long work: a folder that is not there or takes no files would be found only after it.
fn check_output(output: &Path) -> Result<(), Error> {
    let folder = output.parent().filter(|folder| !folder.as_os_str().is_empty());
    match folder {
        Some(folder) if !folder.is_dir() => Err(Error::NoFolder { file: output.to_owned() }),
        // A device or a named pipe would be replaced by the file.
        _ if output.metadata().is_ok_and(|there| !there.is_file()) || output.as_os_str() == "-" => {
            Err(Error::NotAFile { file: output.to_owned() })
        }
        _ => writable::check(output),
    }
}
