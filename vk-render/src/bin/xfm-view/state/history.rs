//! Times of the last frames.

use std::collections::VecDeque;
use std::time::Duration;

/// What one frame took.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct FrameTime {
    /// From its beginning to its end, waiting for the frames before it included.
    pub(crate) whole: Duration,
    /// Tests, updates and loads.
    pub(crate) update: Duration,
    /// Sending changes to the device.
    pub(crate) upload: Duration,
}

/// The last frames, the newest last.
#[derive(Clone, Debug, Default)]
pub(crate) struct History {
    frames: VecDeque<FrameTime>,
}

impl History {
    pub(crate) const MOST: usize = 120;

    pub(crate) fn add(&mut self, frame: FrameTime) {
        if self.frames.len() == Self::MOST {
            self.frames.pop_front();
        }
        self.frames.push_back(frame);
    }

    pub(crate) fn frames(&self) -> impl ExactSizeIterator<Item = &FrameTime> {
        self.frames.iter()
    }

    pub(crate) fn last(&self) -> Option<&FrameTime> {
        self.frames.back()
    }
}
