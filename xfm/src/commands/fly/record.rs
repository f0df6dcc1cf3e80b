//! The frames of a flight, of any number of them in little memory: a flight that looks at memory must not grow itself.

use std::time::Duration;

use xfm_pager::FrameStats;

use crate::spread::Spread;

/// One frame of a flight.
#[derive(Clone, Copy, Debug, Default)]
pub struct Frame {
    pub stats: FrameStats,
    /// All of it: tests, updates, hand-over, and listing what changed for a renderer.
    pub time: Duration,
}

impl Frame {
    /// What is neither test nor update: taking over blocks, letting others go, asking for more, listing what changed.
    pub fn handover_time(&self) -> Duration {
        let FrameStats { test_time, update_time, .. } = self.stats;
        self.time.saturating_sub(test_time + update_time)
    }

    /// Whether anything changed, or is still to come.
    pub fn is_busy(&self, hard_quota: usize) -> bool {
        let FrameStats { updates, is_limited, queued_pages, resident_bytes, .. } = self.stats;
        updates > 0 || is_limited || queued_pages > 0 || resident_bytes > hard_quota
    }
}

/// What is told of frames; times in seconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Figure {
    Time,
    UpdateTime,
    TestTime,
    HandoverTime,
    LoadTime,
    Triangles,
    Updates,
    Tests,
    BlocksLoaded,
    Waiting,
    QueuedPages,
    Pixels,
}

impl Figure {
    const ALL: [Self; 12] = [
        Self::Time,
        Self::UpdateTime,
        Self::TestTime,
        Self::HandoverTime,
        Self::LoadTime,
        Self::Triangles,
        Self::Updates,
        Self::Tests,
        Self::BlocksLoaded,
        Self::Waiting,
        Self::QueuedPages,
        Self::Pixels,
    ];

    fn of(self, frame: &Frame) -> f64 {
        let stats = &frame.stats;
        match self {
            Self::Time => frame.time.as_secs_f64(),
            Self::UpdateTime => stats.update_time.as_secs_f64(),
            Self::TestTime => stats.test_time.as_secs_f64(),
            Self::HandoverTime => frame.handover_time().as_secs_f64(),
            Self::LoadTime => stats.load_time.as_secs_f64(),
            Self::Triangles => stats.triangles_shown as f64,
            Self::Updates => stats.updates as f64,
            Self::Tests => stats.tests as f64,
            Self::BlocksLoaded => stats.blocks_loaded as f64,
            Self::Waiting => stats.waiting as f64,
            Self::QueuedPages => stats.queued_pages as f64,
            Self::Pixels => f64::from(stats.tolerance_px),
        }
    }
}

/// Frames after the first.
#[derive(Debug)]
pub struct Record {
    first: Option<Frame>,
    /// All of them, or when they became too many every so many-th.
    kept: Vec<Frame>,
    every: usize,
    /// The largest of every figure of all frames, kept or not.
    most: [f64; Figure::ALL.len()],
    num_frames: usize,
    num_short_of_memory: usize,
}

impl Record {
    /// With memory for so many frames, taken at once.
    pub fn new(most_kept: usize) -> Self {
        let mut kept = vec![Frame { time: Duration::MAX, ..Frame::default() }; most_kept.max(2)];
        // Written to, so that it is there from the beginning.
        std::hint::black_box(&mut kept);
        kept.clear();
        Self {
            first: None,
            kept,
            every: 1,
            most: [0.0; Figure::ALL.len()],
            num_frames: 0,
            num_short_of_memory: 0,
        }
    }

    pub fn push(&mut self, frame: &Frame) {
        self.num_short_of_memory += usize::from(frame.stats.is_short_of_memory);
        self.num_frames += 1;
        if self.first.is_none() {
            self.first = Some(*frame);
            return;
        }
        for figure in Figure::ALL {
            let most = &mut self.most[figure as usize];
            *most = most.max(figure.of(frame));
        }
        if !(self.num_frames - 2).is_multiple_of(self.every) {
            return;
        }
        if self.kept.len() == self.kept.capacity() {
            let mut index = 0;
            self.kept.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.every *= 2;
            if !(self.num_frames - 2).is_multiple_of(self.every) {
                return;
            }
        }
        self.kept.push(*frame);
    }

    pub fn num_frames(&self) -> usize {
        self.num_frames
    }

    pub fn num_short_of_memory(&self) -> usize {
        self.num_short_of_memory
    }

    pub fn first(&self) -> Option<&Frame> {
        self.first.as_ref()
    }

    /// The frames kept, without the first unless there is no other.
    fn moving(&self) -> &[Frame] {
        match &self.first {
            Some(only) if self.kept.is_empty() => std::slice::from_ref(only),
            _ => &self.kept,
        }
    }

    fn values(&self, figure: Figure) -> impl Iterator<Item = f64> + '_ {
        self.moving().iter().map(move |frame| figure.of(frame))
    }

    pub fn spread(&self, figure: Figure) -> Spread {
        let kept = Spread::of(self.values(figure).collect());
        Spread { max: kept.max.max(self.most[figure as usize]), ..kept }
    }

    pub fn mean(&self, figure: Figure) -> f64 {
        self.values(figure).sum::<f64>() / self.moving().len().max(1) as f64
    }

    /// How many there were of one thing per second of a time.
    pub fn rate(&self, count: Figure, time: Figure) -> f64 {
        self.mean(count) / self.mean(time).max(f64::MIN_POSITIVE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_thinned_evenly_and_the_worst_is_known() {
        let mut record = Record::new(64);
        let capacity = record.kept.capacity();
        for index in 0..10_000 {
            let time = Duration::from_millis(if index == 7777 { 90_000_000 } else { index });
            record.push(&Frame { time, ..Frame::default() });
        }
        let kept = record.moving();
        assert_eq!((record.num_frames(), record.spread(Figure::Time).max), (10_000, 90_000.0));
        assert!((capacity / 2..=capacity).contains(&kept.len()), "{}", kept.len());
        assert_eq!(record.kept.capacity(), capacity);
        let times: Vec<_> = kept.iter().map(|frame| frame.time.as_millis()).collect();
        let even = |w: &[u128]| w[1] - w[0] == record.every as u128;
        assert_eq!(times[0], 1);
        assert!(times.windows(2).all(even), "{times:?}");
    }
}
