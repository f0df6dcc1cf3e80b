//! What `xfm fly` reports.

use std::fmt;
use std::time::Duration;

use serde::Serialize;
use xfm_pager::{FrameStats, PagerStats, Session};

use crate::spread::Spread;
use crate::text;

/// What `xfm fly` reports; times in seconds, sizes in bytes. All but `first_frame_s`, `blocks_loaded` and the sizes leaves
/// the first frame out.
#[derive(Debug, Clone, Serialize)]
pub struct FlyReport {
    frames: usize,
    /// Means per frame.
    triangles_shown: f64,
    updates: f64,
    tests: f64,
    /// In all.
    blocks_loaded: u64,
    pages_read: u64,
    bytes_read: u64,
    blocks_evicted: u64,
    /// At most.
    resident_bytes: usize,
    /// At the end, and what a node takes then with all that is there for it.
    resident_nodes: usize,
    bytes_per_node: f64,
    /// What the front takes, active mesh included.
    front_bytes: usize,
    hard_quota: u64,
    damaged_pages: usize,
    /// Frames in which memory did not suffice for the error asked for.
    frames_short_of_memory: usize,
    /// From opening the file to the first mesh that can be drawn.
    first_frame_s: f64,
    /// After a jump to the middle of the path, until nothing changes any more; null if something always did.
    settling: Option<Settling>,
    frame_s: Spread,
    update_s: Spread,
    test_s: Spread,
    handover_s: Spread,
    /// Reading and unpacking, beside the frames unless there are no loaders.
    load_s: Spread,
    /// Splits and collapses per second of update time.
    updates_per_s: f64,
    /// Tests per second of test time.
    tests_per_s: f64,
    /// The counts above, and the error on the screen in pixels, by frame.
    per_frame: CountSpreads,
}

/// How a view came to rest.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Settling {
    pub seconds: f64,
    pub frames: usize,
}

#[derive(Debug, Clone, Serialize)]
struct CountSpreads {
    triangles_shown: Spread,
    updates: Spread,
    tests: Spread,
    blocks_loaded: Spread,
    waiting: Spread,
    queued_pages: Spread,
    pixels: Spread,
}

/// One frame of a flight.
pub struct Frame {
    pub stats: FrameStats,
    /// All of it: tests, updates, hand-over, and listing what changed for a renderer.
    pub time: Duration,
}

impl Frame {
    /// What is neither test nor update: taking over blocks, letting others go, asking for more, listing what changed.
    fn handover_time(&self) -> Duration {
        let FrameStats { test_time, update_time, .. } = self.stats;
        self.time.saturating_sub(test_time + update_time)
    }
}

impl FlyReport {
    pub fn new(
        frames: &[Frame],
        settling: Option<Settling>,
        session: &Session,
        stats: &PagerStats,
        hard_quota: u64,
    ) -> Self {
        // A flight of one frame has nothing but its first.
        let moving = if frames.len() > 1 { &frames[1..] } else { frames };
        let spread = |get: &dyn Fn(&Frame) -> f64| Spread::of(moving.iter().map(get).collect());
        let time = |get: fn(&Frame) -> Duration| spread(&|frame| get(frame).as_secs_f64());
        let sum = |get: &dyn Fn(&Frame) -> f64| moving.iter().map(get).sum::<f64>();
        let mean =
            |get: fn(&Frame) -> usize| sum(&|frame| get(frame) as f64) / moving.len().max(1) as f64;
        let rate = |count: fn(&Frame) -> usize, time: fn(&Frame) -> Duration| {
            let seconds = sum(&|frame| time(frame).as_secs_f64());
            sum(&|frame| count(frame) as f64) / seconds.max(f64::MIN_POSITIVE)
        };
        Self {
            frames: frames.len(),
            triangles_shown: mean(|frame| frame.stats.triangles_shown),
            updates: mean(|frame| frame.stats.updates),
            tests: mean(|frame| frame.stats.tests),
            blocks_loaded: stats.total.loads + stats.total.read_ahead,
            pages_read: stats.total.pages_inflated,
            bytes_read: stats.total.bytes_read,
            blocks_evicted: stats.total.evictions,
            resident_bytes: stats.peak_bytes,
            resident_nodes: stats.resident_nodes,
            bytes_per_node: stats.resident_bytes as f64 / stats.resident_nodes.max(1) as f64,
            front_bytes: session.front().memory_bytes(),
            hard_quota,
            damaged_pages: stats.damaged_pages,
            frames_short_of_memory: frames
                .iter()
                .filter(|frame| frame.stats.is_short_of_memory)
                .count(),
            first_frame_s: frames.first().map_or(0.0, |frame| frame.time.as_secs_f64()),
            settling,
            frame_s: time(|frame| frame.time),
            update_s: time(|frame| frame.stats.update_time),
            test_s: time(|frame| frame.stats.test_time),
            handover_s: time(Frame::handover_time),
            load_s: time(|frame| frame.stats.load_time),
            updates_per_s: rate(|frame| frame.stats.updates, |frame| frame.stats.update_time),
            tests_per_s: rate(|frame| frame.stats.tests, |frame| frame.stats.test_time),
            per_frame: CountSpreads {
                triangles_shown: spread(&|frame| frame.stats.triangles_shown as f64),
                updates: spread(&|frame| frame.stats.updates as f64),
                tests: spread(&|frame| frame.stats.tests as f64),
                blocks_loaded: spread(&|frame| frame.stats.blocks_loaded as f64),
                waiting: spread(&|frame| frame.stats.waiting as f64),
                queued_pages: spread(&|frame| frame.stats.queued_pages as f64),
                pixels: spread(&|frame| f64::from(frame.stats.tolerance_px)),
            },
        }
    }
}

impl fmt::Display for FlyReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} frames, the first {} after opening the file; {} blocks loaded, resident {} of {} at most, {:.0} bytes per node",
            text::count(self.frames as u64),
            text::seconds(self.first_frame_s),
            text::count(self.blocks_loaded),
            text::size(self.resident_bytes as u64),
            text::size(self.hard_quota),
            self.bytes_per_node,
        )?;
        match self.settling {
            Some(Settling { seconds, frames }) => writeln!(
                f,
                "after a jump the view settled in {} ({} frames)",
                text::seconds(seconds),
                text::count(frames as u64)
            )?,
            None => writeln!(f, "after a jump the view did not settle")?,
        }
        if self.frames_short_of_memory > 0 {
            writeln!(
                f,
                "memory was too little for the error asked for in {} frames: coarser there; raise --hard-quota",
                text::count(self.frames_short_of_memory as u64)
            )?;
        }
        if self.damaged_pages > 0 {
            writeln!(
                f,
                "warning: the detail of {} damaged pages is missing; see `xfm verify`",
                text::count(self.damaged_pages as u64)
            )?;
        }
        write!(f, "{:22}{:>12}{:>12}{:>12}", "per frame", "median", "p99", "max")?;
        let mut row = |name: &str, spread: &Spread, write: fn(f64) -> String| {
            let Spread { median, p99, max, .. } = *spread;
            let [median, p99, max] = [median, p99, max].map(write);
            write!(f, "\n{name:22}{median:>12}{p99:>12}{max:>12}")
        };
        let count: fn(f64) -> String = |value| text::count(value as u64);
        row("triangles shown", &self.per_frame.triangles_shown, count)?;
        row("updates", &self.per_frame.updates, count)?;
        row("view tests", &self.per_frame.tests, count)?;
        row("blocks loaded", &self.per_frame.blocks_loaded, count)?;
        row("waiting for blocks", &self.per_frame.waiting, count)?;
        row("error in pixels", &self.per_frame.pixels, |value| text::number(value, 3))?;
        row("updates (U)", &self.update_s, text::seconds)?;
        row("view tests (VT)", &self.test_s, text::seconds)?;
        row("hand-over", &self.handover_s, text::seconds)?;
        row("frame", &self.frame_s, text::seconds)?;
        row("block loading (BL)", &self.load_s, text::seconds)?;
        write!(
            f,
            "\n{} updates/s, {} tests/s; block loading runs beside the frames",
            text::count(self.updates_per_s as u64),
            text::count(self.tests_per_s as u64)
        )
    }
}
