//! When to stop loading what goes again.

/// Whether loading is of any use while memory is used up: what is loaded and goes again before anything is split is not.
#[derive(Debug)]
pub(super) struct Thrift {
    /// Most nodes that were in blocks that must stay, since the view changed.
    most_held: usize,
    /// Fewest there were when loading was stopped.
    stopped_at: usize,
    /// Frames since then in which requests were refused, or loaded what others had to go for.
    futile: u32,
    pub is_stopped: bool,
}

impl Thrift {
    /// So many frames without any gain are enough.
    const ENOUGH: u32 = 16;

    pub fn new() -> Self {
        Self { most_held: 0, stopped_at: usize::MAX, futile: 0, is_stopped: false }
    }

    /// Stopped, it goes on when clearly fewer blocks must stay than ever when it was stopped: so it stops for good.
    pub fn observe(&mut self, held: usize, in_vain: u64) {
        if self.is_stopped {
            if held < self.stopped_at / 10 * 9 {
                self.is_stopped = false;
                self.futile = 0;
            }
        } else if held > self.most_held {
            self.most_held = held;
            self.futile = 0;
        } else if in_vain > 0 {
            self.futile += 1;
            if self.futile == Self::ENOUGH {
                self.is_stopped = true;
                self.stopped_at = self.stopped_at.min(held);
            }
        }
    }
}
