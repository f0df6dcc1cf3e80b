//! What a pager has and what it did.

use std::time::Duration;

/// What was done in a frame, or altogether.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Counters {
    /// Requests for a node that was resident.
    pub hits: u64,
    /// Requests for a node that was not.
    pub misses: u64,
    /// Blocks loaded that were requested.
    pub loads: u64,
    /// Blocks kept because their page was read for another one.
    pub read_ahead: u64,
    /// Blocks that were not loaded because the hard quota left no room.
    pub refusals: u64,
    /// Pages read and inflated.
    pub pages_inflated: u64,
    /// Bytes of them in the file.
    pub bytes_read: u64,
    /// Blocks removed.
    pub evictions: u64,
    /// Time spent on reading and unpacking pages: by the loaders, or without them by whoever requested.
    pub load_time: Duration,
    /// Time spent on taking blocks over and letting others go.
    pub handover_time: Duration,
}

impl Counters {
    pub(crate) fn add(&mut self, other: &Self) {
        self.hits += other.hits;
        self.misses += other.misses;
        self.loads += other.loads;
        self.read_ahead += other.read_ahead;
        self.refusals += other.refusals;
        self.pages_inflated += other.pages_inflated;
        self.bytes_read += other.bytes_read;
        self.evictions += other.evictions;
        self.load_time += other.load_time;
        self.handover_time += other.handover_time;
    }
}

/// The state of a pager.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct PagerStats {
    /// Blocks in memory.
    pub resident_blocks: usize,
    /// Nodes in memory.
    pub resident_nodes: usize,
    /// All memory the pager takes: nodes, directory, coarsest mesh, page index, inflated pages, working memory.
    pub resident_bytes: usize,
    /// The part of it that is in use; the rest will be used by more blocks, should they come.
    pub used_bytes: usize,
    /// The largest number that `resident_bytes` ever was.
    pub peak_bytes: usize,
    /// Bytes that must stay while the front is as it is: blocks with split nodes, and all that is not blocks.
    pub held_bytes: usize,
    /// Pages that cannot be read.
    pub damaged_pages: usize,
    /// Pages asked for that no loader reads yet.
    pub queued_pages: usize,
    /// Pages being read, or read and not taken over yet.
    pub pages_in_flight: usize,
    /// Since the frame began.
    pub frame: Counters,
    /// Since the file was opened, roots included.
    pub total: Counters,
}
