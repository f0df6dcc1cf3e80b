//! What a frame showed and took.

use std::time::Duration;

use xfm_pager::{FrameStats, Pager};

/// One frame in numbers: the columns of Table 3 of the first paper, and what a pager has to tell. Sizes in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Numbers {
    pub(crate) triangles_shown: usize,
    /// Splits and collapses.
    pub(crate) updates: usize,
    pub(crate) tests: usize,
    /// Nodes that should be split and whose detail is not there.
    pub(crate) waiting: usize,
    pub(crate) tolerance_px: f32,
    pub(crate) blocks_loaded: u64,
    pub(crate) resident_blocks: usize,
    pub(crate) resident_bytes: usize,
    pub(crate) soft_quota: usize,
    pub(crate) hard_quota: usize,
    /// Requests for detail that was there, and for detail that was not.
    pub(crate) hits: u64,
    pub(crate) misses: u64,
    /// Pages that were asked for and are not there yet.
    pub(crate) queue: usize,
    /// Whether there was more to do than a frame may, or vertices are on their way to their places.
    pub(crate) goes_on: bool,
    /// Whether the picture is coarser than was asked for, because memory is used up.
    pub(crate) short_of_memory: bool,
    pub(crate) damaged_pages: usize,
    pub(crate) test_time: Duration,
    pub(crate) update_time: Duration,
    pub(crate) handover_time: Duration,
    /// Of the threads that read.
    pub(crate) load_time: Duration,
}

impl Numbers {
    pub(super) fn of(stats: &FrameStats, pager: &Pager) -> Self {
        let (state, options) = (pager.stats(), pager.options());
        Self {
            triangles_shown: stats.triangles_shown,
            updates: stats.updates,
            tests: stats.tests,
            waiting: stats.waiting,
            tolerance_px: stats.tolerance_px,
            blocks_loaded: stats.blocks_loaded,
            resident_blocks: stats.resident_blocks,
            resident_bytes: stats.resident_bytes,
            soft_quota: options.soft_quota_bytes,
            hard_quota: options.hard_quota_bytes,
            hits: stats.requests[0],
            misses: stats.requests[1],
            queue: stats.queued_pages,
            goes_on: stats.is_limited || stats.morphing > 0,
            short_of_memory: stats.is_short_of_memory,
            damaged_pages: state.damaged_pages,
            test_time: stats.test_time,
            update_time: stats.update_time,
            handover_time: stats.handover_time,
            load_time: stats.load_time,
        }
    }

    /// Whether the picture is as fine as it is going to be.
    pub(crate) fn is_settled(&self) -> bool {
        !self.is_moving() && self.waiting == 0 && self.queue == 0
    }

    /// Whether anything happened, so that the next frame is likely to bring more.
    pub(crate) fn is_moving(&self) -> bool {
        self.updates > 0 || self.blocks_loaded > 0 || self.goes_on
    }

    /// Share of the nodes that were looked at and were in memory, 0 to 1; `None` where none was looked at.
    ///
    /// What is there is not requested, so requests alone would tell of the misses only.
    pub(crate) fn hit_rate(&self) -> Option<f64> {
        let (there, looked_at) =
            (self.tests as u64 + self.hits, self.tests as u64 + self.hits + self.misses);
        (looked_at > 0).then(|| there as f64 / looked_at as f64)
    }
}
