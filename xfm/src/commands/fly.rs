//! `xfm fly`: how fast a file can be viewed, without a window.

mod flight;
mod jumps;
mod memory;
mod record;
mod report;
mod storage;

use std::num::{NonZeroU32, NonZeroUsize};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use mergetree::{Camera, CameraPath, ViewTest};
use xfm_pager::{Detail, Pager, PagerOptions, Session, SessionOptions};

use crate::progress::{Progress, Unit};
use crate::report::ReportTo;
use crate::{Error, interrupt, values};
use flight::{Flight, Length, Route};
use jumps::Jumps;
use memory::MemoryWatch;
use record::Record;
use report::{FlyReport, Landing};

/// Fly a camera over a .xfm file without a window, and time every step
///
/// The columns are those of the XFastMesh paper's Table 3: triangles shown and updates per frame, and the times of updates,
/// view tests and block loading, each with its median, 99th percentile and maximum. Blocks are loaded on threads of their
/// own, so that a frame is tests, updates and hand-over. The first frame, from opening the file to a mesh that can be drawn, is
/// reported by itself; at the end the camera jumps to the middle of the path, and the time is taken until nothing changes.
///
/// With --jumps the camera follows no path: it jumps at random, from far outside to right on the surface, flies straight from one
/// place to the next, looks away, and stays until the view has settled or not; the error on the screen changes between half and
/// twenty times what --pixels says, and the quotas shrink and come back. With --validate everything that must hold of front and
/// pager is checked in between. How much memory there was over the flight is reported in both cases.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
Examples:
  Once around the model, to one pixel
    xfm fly dragon.xfm

  At most 100,000 triangles, in little memory
    xfm fly scan.xfm --budget 100000 --soft-quota 64MiB --hard-quota 128MiB

  On storage that takes 5 ms for each read
    xfm fly scan.xfm --read-delay 5

  Along a recorded path, the slowest frame for a script
    xfm fly scan.xfm --path walk.txt --frames 1000 --json | jq .frame_s.max

  Ten minutes of jumps in little memory, everything checked every 30 frames and whenever a view has settled
    xfm fly scan.xfm --jumps --seconds 600 --hard-quota 8MiB --soft-quota 4MiB --validate=30

A path is a text file with a pose on each line: eye x y z, at x y z, and optionally up x y z, relative to the file's origin
(see xfm info).")]
pub struct FlyArgs {
    /// The .xfm file
    #[arg(value_name = "FILE.xfm")]
    file: PathBuf,
    /// The camera's path: orbit, or a file
    #[arg(long, value_name = "orbit|FILE", default_value = "orbit")]
    path: PathBuf,
    /// Jump at random instead
    #[arg(long, conflicts_with = "path")]
    jumps: bool,
    /// Which jumps: the same number, the same jumps
    #[arg(long, value_name = "S", default_value = "0", requires = "jumps")]
    seed: u64,
    /// Number of frames
    #[arg(long, value_name = "N", default_value = "300")]
    frames: NonZeroU32,
    /// Fly for so long instead of a number of frames
    #[arg(long, value_name = "SECONDS", value_parser = values::positive, conflicts_with = "frames")]
    seconds: Option<f64>,
    /// Check all invariants every so many frames (1 where no number is given), and after a view has settled
    #[arg(long, value_name = "EVERY", num_args = 0..=1, require_equals = true, default_missing_value = "1")]
    validate: Option<NonZeroU32>,
    /// Frames per second: what is left of a frame's time is waited; 0 for as many as there can be
    #[arg(long, value_name = "N", default_value = "60")]
    fps: u32,
    /// Error on the screen, in pixels
    #[arg(long, value_name = "T", default_value = "1", value_parser = values::positive, conflicts_with_all = ["budget", "frame_time"])]
    pixels: f64,
    /// Triangles to show; the error on the screen follows (it is held to within a twentieth)
    #[arg(long, value_name = "TRIANGLES", conflicts_with = "frame_time")]
    budget: Option<NonZeroUsize>,
    /// Milliseconds that a frame may take; the error on the screen follows
    #[arg(long, value_name = "MS", value_parser = values::positive)]
    frame_time: Option<f64>,
    /// Memory above which unused blocks are removed, like 64MiB
    #[arg(long, value_name = "SIZE", default_value = "256MiB", value_parser = values::size)]
    soft_quota: u64,
    /// Memory that is never exceeded
    #[arg(long, value_name = "SIZE", default_value = "512MiB", value_parser = values::size)]
    hard_quota: u64,
    /// Threads that load blocks; 0 to load within the frame. Default: a core fewer than there are, 4 at most
    #[arg(long, value_name = "N")]
    loaders: Option<usize>,
    /// Milliseconds that every read takes longer, to see what slow storage does
    #[arg(long, value_name = "MS", default_value = "0")]
    read_delay: u32,
    /// Splits and collapses of a frame at most
    #[arg(long, value_name = "N", default_value_t = SessionOptions::default().max_updates)]
    max_updates: usize,
    /// Milliseconds that the splits of a frame may take, the collapses half as many; what is left is done in the next frames
    #[arg(long, value_name = "MS", default_value = "1.25", value_parser = values::positive)]
    update_time: f64,
    /// Frames over which a vertex moves to its place, or back
    #[arg(long, value_name = "N", default_value = "0")]
    geomorph: u32,
    /// What of a node is compared with a pixel: how far the surface moves, or as in the paper the extent of what changes
    #[arg(long, value_name = "deviation|radius", default_value = "deviation", value_parser = ["deviation", "radius"])]
    test: String,
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

impl FlyArgs {
    fn length(&self) -> Length {
        match self.seconds {
            Some(seconds) => Length::Time(Duration::from_secs_f64(seconds.min(1e9))),
            None => Length::Frames(self.frames.get() as usize),
        }
    }

    fn lens(&self) -> Camera {
        Camera {
            fov_y: self.fov.to_radians() as f32,
            width: self.size[0],
            height: self.size[1],
            ..Camera::default()
        }
    }

    fn detail(&self) -> Detail {
        match (self.budget, self.frame_time) {
            (Some(triangles), _) => Detail::Budget(triangles.get()),
            (None, Some(ms)) => Detail::FrameTime(Duration::from_secs_f64(1e-3 * ms)),
            (None, None) => Detail::Pixels(self.pixels as f32),
        }
    }

    fn pager_options(&self) -> PagerOptions {
        let bytes = |size| usize::try_from(size).unwrap_or(usize::MAX);
        let loaders = self.loaders.unwrap_or_else(PagerOptions::loaders_for_this_machine);
        PagerOptions::with_quotas(bytes(self.soft_quota), bytes(self.hard_quota))
            .with_loaders(loaders)
    }

    fn session_options(&self) -> SessionOptions {
        let mut options = SessionOptions::default();
        options.max_updates = self.max_updates;
        options.max_update_time = Duration::from_secs_f64(1e-3 * self.update_time);
        options.geomorph_frames = self.geomorph;
        if self.test == "radius" {
            options.test = ViewTest::Radius;
        }
        options
    }
}

/// Frames of a flight of unknown length that are kept at most.
const MOST_KEPT: usize = 4096;

/// Runs the command.
///
/// # Errors
///
/// A file or path that cannot be read, a hard quota that does not hold what must be resident, and with `--validate` an invariant
/// that does not hold.
pub fn run(args: &FlyArgs) -> Result<(), Error> {
    let report = interrupt::freely(|| fly(args))?;
    ReportTo::new(args.json).deliver(&report)
}

fn fly(args: &FlyArgs) -> Result<FlyReport, Error> {
    let opened = Instant::now();
    let (file, own_reads) =
        storage::open(&args.file, Duration::from_millis(args.read_delay.into()))?;
    let (length, lens) = (args.length(), args.lens());
    let [min, max] = file.header().bounds;
    let mut route = if args.jumps {
        Route::Jumps(Box::new(Jumps::new(&file, args.seed, &lens)))
    } else if args.path.as_os_str() == "orbit" {
        // In time there is a pose for every frame of the default number.
        Route::Path(CameraPath::orbit(min, max, args.frames.get() as usize), lens)
    } else {
        Route::Path(read_path(&args.path)?, lens)
    };
    let pager = Pager::new(file, args.pager_options())?;
    let session = Session::with_options(pager, args.session_options())?;
    let mut flight = Flight::new(session, args, own_reads);
    let mut record = Record::new(length.frames().unwrap_or(MOST_KEPT));
    let mut memory = MemoryWatch::start();
    let begin = Instant::now();
    let progress = Progress::new("flying", Some(length.units()), Unit::Items);
    while let Some(share) = length.share(record.num_frames(), begin) {
        let mut frame = flight.follow(&mut route, share)?;
        if record.num_frames() == 0 {
            frame.time = opened.elapsed();
        }
        flight.wait(&frame);
        record.push(&frame);
        let done = length.done(record.num_frames(), begin);
        memory.look(record.num_frames(), done, flight.session());
        progress.set((done * length.units() as f64) as u64);
    }
    let memory = memory.report();
    let settling = flight.settle(&route)?;
    let jumps = match &route {
        Route::Jumps(jumps) => Some(jumps.report()),
        Route::Path(..) => None,
    };
    let landing = Landing {
        settling,
        jumps,
        memory,
        validations: flight.validations(args.validate.is_some()),
    };
    Ok(FlyReport::new(&record, landing, flight.session(), args.hard_quota))
}

fn read_path(file: &Path) -> Result<CameraPath, Error> {
    let text = std::fs::read_to_string(file)
        .map_err(|source| Error::ReadPath { file: file.to_owned(), source })?;
    CameraPath::parse(&text).map_err(|source| Error::CameraPath { file: file.to_owned(), source })
}
