//! `xfm diff`: the distance between two meshes.

use std::fmt;
use std::num::{NonZeroU32, NonZeroUsize};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Instant;

use serde::Serialize;

use crate::distance::{
    DistanceError, DistanceOptions, DistanceReport, Observer, OneSided, Side, Surface,
    measure_observed,
};
use crate::mesh_file::read_mesh;
use crate::progress::{Progress, Unit};
use crate::report::ReportTo;
use crate::threads::with_threads;
use crate::{Error, interrupt, text};

/// Two-sided distance between the surfaces of two meshes: maximum, mean and RMS
///
/// `a_to_b` is measured from points spread evenly over the surface of A to the exact nearest point of the surface of B (not
/// to its vertices); `b_to_a` is the reverse. Mean and RMS are averages by area; the maximum also looks at every vertex.
/// Percentages are of the diagonal of A's bounding box. The result is the same on every run and for any number of threads.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
Examples:
  How far is a decimated mesh from its original?
    xfm diff dragon.ply dragon-17k.ply

  The larger of the two maxima, for a script
    xfm diff a.stl b.stl --json | jq '[.a_to_b.max, .b_to_a.max] | max'

  Ten times the samples, for one more reliable digit
    xfm diff scan.obj.gz scan.glb --samples 5000000")]
pub struct DiffArgs {
    /// The first mesh; percentages refer to its bounding box
    #[arg(value_name = "A")]
    a: PathBuf,
    /// The second mesh
    #[arg(value_name = "B")]
    b: PathBuf,
    /// Samples on each surface, besides the vertices
    #[arg(long, value_name = "N", default_value = "500000")]
    samples: NonZeroU32,
    /// Worker threads [default: one for each core]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// Report as JSON on standard output
    #[arg(long)]
    json: bool,
}

/// What `xfm diff` reports; distances in model units, percentages of the diagonal.
#[derive(Debug, Clone, Serialize)]
struct DiffReport {
    diagonal: f64,
    a_to_b: SideReport,
    b_to_a: SideReport,
    samples: u32,
    a_triangles: usize,
    b_triangles: usize,
    seconds: f64,
}

/// One direction of the comparison.
#[derive(Debug, Clone, Serialize)]
struct SideReport {
    max: f64,
    mean: f64,
    rms: f64,
    max_percent: f64,
    mean_percent: f64,
    rms_percent: f64,
}

impl SideReport {
    fn new(side: OneSided, diagonal: f64) -> Self {
        let percent = |distance: f64| distance / diagonal * 100.0;
        Self {
            max: side.max,
            mean: side.mean,
            rms: side.rms,
            max_percent: percent(side.max),
            mean_percent: percent(side.mean),
            rms_percent: percent(side.rms),
        }
    }
}

impl fmt::Display for DiffReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "A {} triangles, B {} triangles, {} samples on each, {}",
            text::count(self.a_triangles as u64),
            text::count(self.b_triangles as u64),
            text::count(self.samples),
            text::seconds(self.seconds)
        )?;
        writeln!(f, "diagonal of A's bounding box: {}", text::number(self.diagonal, 6))?;
        writeln!(f, "{:8}{:>26}{:>26}{:>26}", "", "max", "mean", "rms")?;
        let cell = |distance, percent| {
            format!("{} ({} %)", text::number(distance, 4), text::number(percent, 4))
        };
        let row = |name: &str, side: &SideReport| {
            format!(
                "{name:8}{:>26}{:>26}{:>26}",
                cell(side.max, side.max_percent),
                cell(side.mean, side.mean_percent),
                cell(side.rms, side.rms_percent)
            )
        };
        writeln!(f, "{}", row("A to B", &self.a_to_b))?;
        write!(f, "{}", row("B to A", &self.b_to_a))
    }
}

/// Runs the command.
///
/// # Errors
///
/// A file that cannot be read or has nothing to measure, and an interruption.
pub fn run(args: &DiffArgs) -> Result<(), Error> {
    let start = Instant::now();
    let (report, a_triangles, b_triangles) = with_threads(args.threads, || compare(args))?;
    let DistanceReport { diagonal, a_to_b, b_to_a } = report;
    ReportTo::new(args.json).deliver(&DiffReport {
        diagonal,
        a_to_b: SideReport::new(a_to_b, diagonal),
        b_to_a: SideReport::new(b_to_a, diagonal),
        samples: args.samples.get(),
        a_triangles,
        b_triangles,
        seconds: start.elapsed().as_secs_f64(),
    })
}

fn compare(args: &DiffArgs) -> Result<(DistanceReport, usize, usize), Error> {
    let (a, b) = rayon::join(|| read_surface(&args.a), || read_surface(&args.b));
    let (a, b) = (a?, b?);
    interrupt::check()?;
    let options = DistanceOptions { samples: args.samples.get() as usize, ..Default::default() };
    let report = measure_observed(&a, &b, &options, &Bar::default()).map_err(|source| {
        let name = |path: &Path| path.display().to_string();
        match source {
            DistanceError::Cancelled => Error::Interrupted,
            DistanceError::NoArea { side: Side::A, .. } => {
                Error::Distance { name: name(&args.a), source }
            }
            _ => Error::Distance { name: name(&args.b), source },
        }
    })?;
    Ok((report, a.num_triangles(), b.num_triangles()))
}

fn read_surface(path: &Path) -> Result<Surface, Error> {
    let mesh = read_mesh(path, None)?;
    let positions = mesh.positions.iter().map(|position| position.as_dvec3()).collect();
    Surface::new(positions, mesh.triangles)
        .map_err(|source| Error::Distance { name: path.display().to_string(), source })
}

/// Shows the measurement's progress and passes Ctrl-C on to it.
#[derive(Default)]
struct Bar(OnceLock<Progress>);

impl Observer for Bar {
    fn begin(&self, total_points: u64) {
        self.0.get_or_init(|| Progress::new("measuring", Some(total_points), Unit::Items));
    }

    fn advance(&self, points: u64) {
        if let Some(progress) = self.0.get() {
            progress.advance(points);
        }
    }

    fn is_cancelled(&self) -> bool {
        interrupt::is_requested()
    }
}
