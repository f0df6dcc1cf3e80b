//! `xfm fly`: how fast a file can be viewed, without a window.

mod report;
mod slow;

use std::num::{NonZeroU32, NonZeroUsize};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use mergetree::{Camera, CameraPath, ViewTest};
use xfm_pager::{Detail, Pager, PagerOptions, Session, SessionOptions};

use crate::progress::{Progress, Unit};
use crate::report::ReportTo;
use crate::{Error, interrupt, values, xfm_file};
use report::{FlyReport, Frame, Settling};

/// Fly a camera over a .xfm file without a window, and time every step
///
/// The columns are those of the XFastMesh paper's Table 3: triangles shown and updates per frame, and the times of updates,
/// view tests and block loading, each with its median, 99th percentile and maximum. Blocks are loaded on threads of their
/// own, so that a frame is tests, updates and hand-over. The first frame, from opening the file to a mesh that can be drawn, is
/// reported by itself; at the end the camera jumps to the middle of the path, and the time is taken until nothing changes.
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
    #[arg(long, value_name = "MS", default_value = "2", value_parser = values::positive)]
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

/// Frames that a view has to settle after a jump.
const MOST_SETTLING_FRAMES: usize = 1200;

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
    let opened = Instant::now();
    let delay = Duration::from_millis(args.read_delay.into());
    let file =
        if delay.is_zero() { xfm_file::open(&args.file)? } else { slow::open(&args.file, delay)? };
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
    let pager = Pager::new(file, args.pager_options())?;
    let session = Session::with_options(pager, args.session_options())?;
    let mut flight = Flight { session, detail: args.detail(), fps: args.fps };
    let progress = Progress::new("flying", Some(frames as u64), Unit::Items);
    let mut flown = Vec::with_capacity(frames);
    for index in 0..frames {
        let mut frame =
            flight.frame(&path.camera(index as f32 / (frames - 1).max(1) as f32, &lens));
        if index == 0 {
            frame.time = opened.elapsed();
        }
        flight.wait(&frame);
        flown.push(frame);
        progress.advance(1);
    }
    let settling = flight.settle(&path.camera(0.5, &lens));
    let stats = flight.session.pager().stats();
    Ok(FlyReport::new(&flown, settling, &flight.session, &stats, args.hard_quota))
}

/// A session that is flown.
struct Flight {
    session: Session,
    detail: Detail,
    fps: u32,
}

impl Flight {
    fn frame(&mut self, camera: &Camera) -> Frame {
        let start = Instant::now();
        let stats = self.session.frame(camera, self.detail);
        drop(self.session.take_changes());
        Frame { stats, time: start.elapsed() }
    }

    /// Waits until the next frame is due.
    fn wait(&self, frame: &Frame) {
        if self.fps > 0 {
            let due = Duration::from_secs(1) / self.fps;
            std::thread::sleep(due.saturating_sub(frame.time));
        }
    }

    /// Jumps to a camera and flies on the spot until nothing changes any more.
    fn settle(&mut self, camera: &Camera) -> Option<Settling> {
        let start = Instant::now();
        let mut last_change = Duration::ZERO;
        let mut quiet = 0;
        for index in 0..MOST_SETTLING_FRAMES {
            let frame = self.frame(camera);
            let stats = &frame.stats;
            let changed = stats.updates > 0 || stats.is_limited || stats.queued_pages > 0;
            if changed {
                last_change = start.elapsed();
                quiet = 0;
            } else {
                quiet += 1;
            }
            if quiet == 10 {
                return Some(Settling { seconds: last_change.as_secs_f64(), frames: index - 9 });
            }
            self.wait(&frame);
        }
        None
    }
}

fn read_path(file: &Path) -> Result<CameraPath, Error> {
    let text = std::fs::read_to_string(file)
        .map_err(|source| Error::ReadPath { file: file.to_owned(), source })?;
    CameraPath::parse(&text).map_err(|source| Error::CameraPath { file: file.to_owned(), source })
}
