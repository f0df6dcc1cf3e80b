//! `xfm build`: from a mesh to a `.xfm` file.

use std::fmt;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::ValueEnum;
use mergetree::{BuildOptions, Forest};
use mesh_io::{Format, IndexedMesh};
use serde::Serialize;
use xfm_format::{Precision, WriteOptions, WriteReport};

use crate::memory::{AnonymousPeak, peak_rss};
use crate::mesh_file::read_mesh_in_frame;
use crate::progress::{Progress, Unit};
use crate::repaired::{self, Repaired};
use crate::report::ReportTo;
use crate::threads::with_threads;
use crate::{Error, interrupt, text, values};

/// Anonymous memory that building in core takes per triangle at its peak, with a reserve: between 100 and 130 were measured.
const BYTES_PER_TRIANGLE: u64 = 160;
/// And whatever the size of the mesh.
const BYTES_ALWAYS: u64 = 24 << 20;

/// Build a view-dependent .xfm file from a mesh
///
/// The input is welded and repaired into a manifold first; what that took is reported. Positions are kept bit for bit, those far
/// from zero about an origin near them, so that they keep their digits. The file appears whole or not at all, and is the same, byte for byte, for any number of threads.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
Examples:
  Build, then look at what came out
    xfm build dragon.ply dragon.xfm
    xfm info dragon.xfm

  From a pipe, with more memory allowed
    gunzip -c scan.stl.gz | xfm build - scan.xfm --memory 8GiB

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
    /// Format of the input where its name does not tell: stl, ply, obj, gltf, glb
    #[arg(long, value_name = "FMT", value_parser = values::format)]
    from: Option<Format>,
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
    /// Quantised (not available yet)
    Compact,
}

/// What `xfm build` reports; sizes in bytes.
#[derive(Debug, Clone, Serialize)]
struct BuildReport {
    input_triangles: u64,
    mode: &'static str,
    seconds: f64,
    peak_rss: Option<u64>,
    peak_anon: Option<u64>,
    memory: u64,
    file_bytes: u64,
    bytes_per_triangle: f64,
    nodes: u64,
    base_triangles: u64,
    tree_depth: u64,
    blocks: u64,
    pages: u64,
    fill: f64,
    scratch_bytes: u64,
    repaired: Repaired,
}

impl fmt::Display for BuildReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} triangles in {} ({}), {} per triangle",
            text::count(self.input_triangles),
            text::seconds(self.seconds),
            self.mode,
            text::seconds(self.seconds / self.input_triangles as f64)
        )?;
        if let Some(repaired) = repaired::words(&self.repaired) {
            writeln!(f, "repaired: {repaired}")?;
        }
        writeln!(
            f,
            "file {}, {:.1} bytes per triangle: {} nodes over {} triangles, {} levels deep; {} blocks, {:.0} % full, in {} pages",
            text::size(self.file_bytes),
            self.bytes_per_triangle,
            text::count(self.nodes),
            text::count(self.base_triangles),
            self.tree_depth,
            text::count(self.blocks),
            self.fill * 100.0,
            text::count(self.pages)
        )?;
        match self.peak_anon {
            Some(peak) => write!(f, "peak {} of {}", text::size(peak), text::size(self.memory)),
            None => write!(f, "memory allowed {}", text::size(self.memory)),
        }
    }
}

/// Runs the command.
///
/// # Errors
///
/// An input that cannot be read, has nothing in it, or is too large for the memory; an output that cannot be written.
pub fn run(args: &BuildArgs) -> Result<(), Error> {
    let start = Instant::now();
    if args.encoding == EncodingArg::Compact {
        return Err(Error::NoCompactEncoding);
    }
    check_output(&args.output)?;
    let peak = AnonymousPeak::watch();
    let built = with_threads(args.threads, || build(args))?;
    ReportTo::new(args.json).deliver(&BuildReport {
        input_triangles: built.input_triangles,
        mode: "in-core",
        seconds: start.elapsed().as_secs_f64(),
        peak_rss: peak_rss(),
        peak_anon: peak.so_far(),
        memory: args.memory,
        file_bytes: built.written.file_bytes,
        bytes_per_triangle: built.written.file_bytes as f64 / built.input_triangles as f64,
        nodes: built.nodes,
        base_triangles: built.base_triangles,
        tree_depth: built.written.tree_depth,
        blocks: built.written.blocks,
        pages: built.written.pages,
        fill: built.written.fill,
        scratch_bytes: 0,
        repaired: built.repaired,
    })
}

/// What came of a build.
struct Built {
    input_triangles: u64,
    nodes: u64,
    base_triangles: u64,
    repaired: Repaired,
    written: WriteReport,
}

fn build(args: &BuildArgs) -> Result<Built, Error> {
    let (mesh, frame) = read_mesh_in_frame(&args.input, args.from)?;
    let input_triangles = mesh.triangles.len() as u64;
    check_memory(&args.input, input_triangles, args.memory)?;
    let (forest, repaired) = to_forest(&args.input, mesh)?;
    interrupt::check()?;
    let mut options = WriteOptions::default();
    options.levels = args.levels;
    options.origin = frame.origin;
    options.precision = if frame.double { Precision::Double } else { Precision::Single };
    let written = xfm_format::write(&forest, &args.output, &options)?;
    Ok(Built {
        input_triangles,
        nodes: forest.nodes.len() as u64,
        base_triangles: forest.base.faces.len() as u64,
        repaired,
        written,
    })
}

/// Before the long work: a folder that is not there would be found only after it.
fn check_output(output: &Path) -> Result<(), Error> {
    let folder = output.parent().filter(|folder| !folder.as_os_str().is_empty());
    match folder {
        Some(folder) if !folder.is_dir() => Err(Error::NoFolder { file: output.to_owned() }),
        _ if output.is_dir() || output.as_os_str() == "-" => {
            Err(Error::NotAFile { file: output.to_owned() })
        }
        _ => Ok(()),
    }
}

fn check_memory(input: &Path, triangles: u64, memory: u64) -> Result<(), Error> {
    let needed = BYTES_ALWAYS + triangles.saturating_mul(BYTES_PER_TRIANGLE);
    if needed > memory {
        return Err(Error::MemoryTooSmall { file: input.to_owned(), triangles, needed, memory });
    }
    Ok(())
}

/// Repairs the mesh and builds its forest. Nothing is on the disk yet, so Ctrl-C may end the process at once.
fn to_forest(input: &Path, mesh: IndexedMesh) -> Result<(Forest, Repaired), Error> {
    interrupt::freely(|| {
        let repaired = halfedge::repair(&mesh.positions, &mesh.triangles)
            .map_err(|source| Error::Repair { file: input.to_owned(), source })?;
        drop(mesh);
        if repaired.mesh.num_faces() == 0 {
            return Err(Error::NothingToBuild { file: input.to_owned() });
        }
        let counts = repaired::counts(&repaired.report);
        const STEPS: f32 = 1000.0;
        let progress = Progress::new("building", Some(STEPS as u64), Unit::Items);
        let forest = mergetree::build(
            repaired.mesh,
            &repaired.positions,
            &BuildOptions::default(),
            &|share| progress.set((share * STEPS) as u64),
        )
        .map_err(|source| Error::Forest { file: input.to_owned(), source })?;
        Ok((forest, counts))
    })
}
