//! What `xfm fly` reports.

use std::fmt;

use serde::Serialize;
use xfm_pager::Session;

use super::jumps::JumpReport;
use super::memory::MemoryReport;
use super::record::{Figure, Record};
use crate::spread::Spread;
use crate::text;

/// What `xfm fly` reports; times in seconds, sizes in bytes. All but `first_frame_s`, `blocks_loaded` and the sizes leaves
/// the first frame out. Of a flight in time the spreads are of frames
/// evenly chosen, their maxima of all.
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
    /// The least hard quota that the file can be opened with.
    least_quota: usize,
    damaged_pages: usize,
    /// Frames in which memory did not suffice for the error asked for.
    frames_short_of_memory: usize,
    /// From opening the file to the first mesh that can be drawn.
    first_frame_s: f64,
    /// After a jump to the middle of the path, until nothing changes any more; null if something always did.
    settling: Option<Settling>,
    /// Of a camera that jumps; else null.
    jumps: Option<JumpReport>,
    memory: MemoryReport,
    /// How often all invariants were checked; null where that was not asked for.
    validations: Option<usize>,
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

/// What is known at the end of a flight beside its frames.
pub struct Landing {
    pub settling: Option<Settling>,
    pub jumps: Option<JumpReport>,
    pub memory: MemoryReport,
    pub validations: Option<usize>,
}

impl FlyReport {
    pub fn new(record: &Record, landing: Landing, session: &Session, hard_quota: u64) -> Self {
        let stats = session.pager().stats();
        Self {
            frames: record.num_frames(),
            triangles_shown: record.mean(Figure::Triangles),
            updates: record.mean(Figure::Updates),
            tests: record.mean(Figure::Tests),
            blocks_loaded: stats.total.loads + stats.total.read_ahead,
            pages_read: stats.total.pages_inflated,
            bytes_read: stats.total.bytes_read,
            blocks_evicted: stats.total.evictions,
            resident_bytes: stats.peak_bytes,
            resident_nodes: stats.resident_nodes,
            bytes_per_node: stats.resident_bytes as f64 / stats.resident_nodes.max(1) as f64,
            front_bytes: session.front().memory_bytes(),
            hard_quota,
            least_quota: session.pager().least_quota_bytes(),
            damaged_pages: stats.damaged_pages,
            frames_short_of_memory: record.num_short_of_memory(),
            first_frame_s: record.first().map_or(0.0, |frame| frame.time.as_secs_f64()),
            settling: landing.settling,
            jumps: landing.jumps,
            memory: landing.memory,
            validations: landing.validations,
            frame_s: record.spread(Figure::Time),
            update_s: record.spread(Figure::UpdateTime),
            test_s: record.spread(Figure::TestTime),
            handover_s: record.spread(Figure::HandoverTime),
            load_s: record.spread(Figure::LoadTime),
            updates_per_s: record.rate(Figure::Updates, Figure::UpdateTime),
            tests_per_s: record.rate(Figure::Tests, Figure::TestTime),
            per_frame: CountSpreads {
                triangles_shown: record.spread(Figure::Triangles),
                updates: record.spread(Figure::Updates),
                tests: record.spread(Figure::Tests),
                blocks_loaded: record.spread(Figure::BlocksLoaded),
                waiting: record.spread(Figure::Waiting),
                queued_pages: record.spread(Figure::QueuedPages),
                pixels: record.spread(Figure::Pixels),
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
        if let Some(jumps) = &self.jumps {
            writeln!(f, "{jumps}")?;
        }
        if let Some(validations) = self.validations {
            writeln!(f, "all invariants hold, checked {} times", text::count(validations as u64))?;
        }
        writeln!(f, "{}", self.memory)?;
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
