//! `xfm fly`: how fast a file can be viewed, without a window.

use std::fmt;
use std::num::{NonZeroU32, NonZeroUsize};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use mergetree::{Camera, CameraPath, Dependencies};
use serde::Serialize;
use xfm_pager::{Detail, FrameStats, Pager, PagerOptions, PagerStats, Session};

use crate::progress::{Progress, Unit};
use crate::report::ReportTo;
use crate::spread::Spread;
use crate::{Error, interrupt, text, values, xfm_file};

/// Fly a camera over a .xfm file without a window, and time every step
///
/// The columns are those of the XFastMesh paper's Table 3: triangles shown and updates per frame, and the times of updates,
/// view tests and block loading, each with its median, 99th percentile and maximum. The first frame, which refines from the
/// coarsest mesh, is reported by itself.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
Examples:
  Once around the model, to one pixel
    xfm fly dragon.xfm

  At most 100,000 triangles, in little memory
    xfm fly scan.xfm --budget 100000 --soft-quota 64MiB --hard-quota 128MiB

  Along a recorded path, the slowest frame for a script
    xfm fly scan.xfm --path walk.txt --frames 1000 --json | jq .frame_s.max

A path is a text file with a pose on each line: eye x y z, at x y z, and optionally up x y z, relative to the file's origin
(see xfm info).")]
pub struct FlyArgs {
    /// The .xfm file
    #[arg(value_name = "FILE.xfm")]
    file: PathBuf,
    /// The camera's path: orbit, or a file
    #[arg(long, value_name = "orbit|FILE", default_value = "orbit")]
    path: PathBuf,
    /// Number of frames
    #[arg(long, value_name = "N", default_value = "300")]
    frames: NonZeroU32,
    /// Error on the screen, in pixels
    #[arg(long, value_name = "T", default_value = "1", value_parser = values::positive, conflicts_with = "budget")]
    pixels: f64,
    /// Triangles to show; the error on the screen follows (it is held to within a twentieth)
    #[arg(long, value_name = "TRIANGLES")]
    budget: Option<NonZeroUsize>,
    /// Memory above which unused blocks are removed, like 64MiB
    #[arg(long, value_name = "SIZE", default_value = "256MiB", value_parser = values::size)]
    soft_quota: u64,
    /// Memory that is never exceeded
    #[arg(long, value_name = "SIZE", default_value = "512MiB", value_parser = values::size)]
    hard_quota: u64,
    /// Size of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = values::image_size)]
    size: [u32; 2],
    /// The camera's vertical angle of view in degrees
    #[arg(long, value_name = "DEG", default_value = "45", value_parser = values::field_of_view)]
    fov: f64,
    /// Report as JSON on standard output
    #[arg(long)]
    json: bool,
}

/// What `xfm fly` reports; times in seconds, sizes in bytes. All but `first_frame_s`, `blocks_loaded` and `resident_bytes`
/// leaves the first frame out.
#[derive(Debug, Clone, Serialize)]
struct FlyReport {
    frames: usize,
    /// Means per frame.
    triangles_shown: f64,
    updates: f64,
    tests: f64,
    /// In all.
    blocks_loaded: u64,
    /// At most.
    resident_bytes: usize,
    hard_quota: u64,
    damaged_pages: usize,
    first_frame_s: f64,
    frame_s: Spread,
    update_s: Spread,
    test_s: Spread,
    handover_s: Spread,
    load_s: Spread,
    /// The counts above, and the error on the screen in pixels, by frame.
    per_frame: CountSpreads,
}

#[derive(Debug, Clone, Serialize)]
struct CountSpreads {
    triangles_shown: Spread,
    updates: Spread,
    tests: Spread,
    blocks_loaded: Spread,
    pixels: Spread,
}

/// One frame of a flight.
struct Frame {
    stats: FrameStats,
    /// All of it: tests, updates, loads, and listing what changed for a renderer.
    time: Duration,
}

impl Frame {
    /// What is neither test nor update nor load: taking over blocks, letting others go, listing what changed.
    fn handover_time(&self) -> Duration {
        let FrameStats { test_time, update_time, load_time, .. } = self.stats;
        self.time.saturating_sub(test_time + update_time + load_time)
    }
}

impl FlyReport {
    fn new(frames: &[Frame], stats: &PagerStats, hard_quota: u64) -> Self {
        // A flight of one frame has nothing but its first.
        let moving = if frames.len() > 1 { &frames[1..] } else { frames };
        let spread = |get: &dyn Fn(&Frame) -> f64| Spread::of(moving.iter().map(get).collect());
        let time = |get: fn(&Frame) -> Duration| spread(&|frame| get(frame).as_secs_f64());
        let mean = |get: fn(&Frame) -> usize| {
            moving.iter().map(|frame| get(frame) as f64).sum::<f64>() / moving.len().max(1) as f64
        };
        Self {
            frames: frames.len(),
            triangles_shown: mean(|frame| frame.stats.triangles_shown),
            updates: mean(|frame| frame.stats.updates),
            tests: mean(|frame| frame.stats.tests),
            blocks_loaded: frames.iter().map(|frame| frame.stats.blocks_loaded).sum(),
            resident_bytes: stats.peak_bytes,
            hard_quota,
            damaged_pages: stats.damaged_pages,
            first_frame_s: frames.first().map_or(0.0, |frame| frame.time.as_secs_f64()),
            frame_s: time(|frame| frame.time),
            update_s: time(|frame| frame.stats.update_time),
            test_s: time(|frame| frame.stats.test_time),
            handover_s: time(|frame| frame.handover_time()),
            load_s: time(|frame| frame.stats.load_time),
            per_frame: CountSpreads {
                triangles_shown: spread(&|frame| frame.stats.triangles_shown as f64),
                updates: spread(&|frame| frame.stats.updates as f64),
                tests: spread(&|frame| frame.stats.tests as f64),
                blocks_loaded: spread(&|frame| frame.stats.blocks_loaded as f64),
                pixels: spread(&|frame| f64::from(frame.stats.tolerance_px)),
            },
        }
    }
}

impl fmt::Display for FlyReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} frames, the first in {}; {} blocks loaded, resident {} of {} at most",
            text::count(self.frames as u64),
            text::seconds(self.first_frame_s),
            text::count(self.blocks_loaded),
            text::size(self.resident_bytes as u64),
            text::size(self.hard_quota)
        )?;
        if self.damaged_pages > 0 {
            writeln!(
                f,
                "warning: the detail of {} damaged pages is missing; see `xfm verify`",
                text::count(self.damaged_pages as u64)
            )?;
        }
        write!(f, "{:22}{:>12}{:>12}{:>12}", "per frame", "median", "p99", "max")?;
        let mut row = |name: &str, spread: &Spread, write: fn(f64) -> String| {
            let Spread { median, p99, max } = *spread;
            let [median, p99, max] = [median, p99, max].map(write);
            write!(f, "\n{name:22}{median:>12}{p99:>12}{max:>12}")
        };
        let count: fn(f64) -> String = |value| text::count(value as u64);
        row("triangles shown", &self.per_frame.triangles_shown, count)?;
        row("updates", &self.per_frame.updates, count)?;
        row("view tests", &self.per_frame.tests, count)?;
        row("blocks loaded", &self.per_frame.blocks_loaded, count)?;
        row("error in pixels", &self.per_frame.pixels, |value| text::number(value, 3))?;
        row("updates (U)", &self.update_s, text::seconds)?;
        row("view tests (VT)", &self.test_s, text::seconds)?;
        row("block loading (BL)", &self.load_s, text::seconds)?;
        row("hand-over", &self.handover_s, text::seconds)?;
        row("frame", &self.frame_s, text::seconds)
    }
}

/// Runs the command.
///
/// # Errors
///
/// A file or path that cannot be read, and a hard quota that does not hold what must be resident.
pub fn run(args: &FlyArgs) -> Result<(), Error> {
    let report = interrupt::freely(|| fly(args))?;
    ReportTo::new(args.json).deliver(&report)
}

fn fly(args: &FlyArgs) -> Result<FlyReport, Error> {
    let file = xfm_file::open(&args.file)?;
    let frames = args.frames.get() as usize;
    let [min, max] = file.header().bounds;
    let path = if args.path.as_os_str() == "orbit" {
        CameraPath::orbit(min, max, frames)
    } else {
        read_path(&args.path)?
    };
    let lens = Camera {
        fov_y: args.fov.to_radians() as f32,
        width: args.size[0],
        height: args.size[1],
        ..Camera::default()
    };
    let detail = match args.budget {
        Some(triangles) => Detail::Budget(triangles.get()),
        None => Detail::Pixels(args.pixels as f32),
    };
    let bytes = |size| usize::try_from(size).unwrap_or(usize::MAX);
    let quotas = PagerOptions::with_quotas(bytes(args.soft_quota), bytes(args.hard_quota));
    let mut session = Session::new(Pager::new(file, quotas)?, Dependencies::Order)?;
    let progress = Progress::new("flying", Some(frames as u64), Unit::Items);
    let mut flown = Vec::with_capacity(frames);
    for index in 0..frames {
        let camera = path.camera(index as f32 / (frames - 1).max(1) as f32, &lens);
        let start = Instant::now();
        let stats = session.frame(&camera, detail);
        drop(session.take_changes());
        flown.push(Frame { stats, time: start.elapsed() });
        progress.advance(1);
    }
    Ok(FlyReport::new(&flown, &session.pager().stats(), args.hard_quota))
}

fn read_path(file: &Path) -> Result<CameraPath, Error> {
    let text = std::fs::read_to_string(file)
        .map_err(|source| Error::ReadPath { file: file.to_owned(), source })?;
    CameraPath::parse(&text).map_err(|source| Error::CameraPath { file: file.to_owned(), source })
}
