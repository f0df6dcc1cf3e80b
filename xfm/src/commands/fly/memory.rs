//! Memory over a flight: whether it grows.

use std::fmt;
use std::time::Instant;

use serde::Serialize;
use xfm_pager::Session;

use crate::{memory, text};

/// Samples of a flight, however long it is.
const NUM_SAMPLES: usize = 60;
/// The operating system is asked every so many frames.
const EVERY: usize = 4;

/// The most there was since the sample before; sizes in bytes.
#[derive(Debug, Clone, Copy, Default, Serialize)]
struct Sample {
    /// Since the flight began, and the frame.
    seconds: f64,
    frame: usize,
    /// Physical memory of the process, and the part of it that no file backs; null where the system does not tell.
    rss: Option<u64>,
    anonymous: Option<u64>,
    /// What the front takes, and the pager as it counts itself; of that the part in use at the time of the sample.
    front: usize,
    pager: usize,
    pager_used: usize,
}

/// Medians of a quarter's samples, and how much more the last quarter's is.
#[derive(Debug, Clone, Copy, Serialize)]
struct Trend {
    second_quarter: u64,
    last_quarter: u64,
    /// As a share of the second quarter.
    growth: f64,
}

/// Memory over a flight.
#[derive(Debug, Clone, Serialize)]
pub struct MemoryReport {
    /// Null where the system does not tell, or there are too few frames.
    rss: Option<Trend>,
    anonymous: Option<Trend>,
    front: Option<Trend>,
    pager: Option<Trend>,
    samples: Vec<Sample>,
}

/// Takes the samples.
#[derive(Debug)]
pub struct MemoryWatch {
    begin: Instant,
    samples: Vec<Sample>,
    present: Sample,
}

impl MemoryWatch {
    pub fn start() -> Self {
        let samples = Vec::with_capacity(NUM_SAMPLES + 1);
        Self { begin: Instant::now(), samples, present: Sample::default() }
    }

    /// Looks after a frame, at this share of the flight.
    pub fn look(&mut self, frame: usize, share: f64, session: &Session) {
        let is_due = share * NUM_SAMPLES as f64 >= (self.samples.len() + 1) as f64;
        let present = &mut self.present;
        present.front = present.front.max(session.front().memory_bytes());
        present.pager = present.pager.max(session.pager().resident_bytes());
        if is_due || frame.is_multiple_of(EVERY) {
            present.rss = present.rss.max(memory::resident());
            present.anonymous = present.anonymous.max(memory::anonymous());
        }
        if is_due && self.samples.len() < NUM_SAMPLES {
            present.seconds = self.begin.elapsed().as_secs_f64();
            present.frame = frame;
            present.pager_used = session.pager().used_bytes();
            self.samples.push(std::mem::take(present));
        }
    }

    pub fn report(self) -> MemoryReport {
        let trend = |get: fn(&Sample) -> Option<u64>| trend(&self.samples, get);
        MemoryReport {
            rss: trend(|sample| sample.rss),
            anonymous: trend(|sample| sample.anonymous),
            front: trend(|sample| Some(sample.front as u64)),
            pager: trend(|sample| Some(sample.pager as u64)),
            samples: self.samples,
        }
    }
}

fn trend(samples: &[Sample], get: fn(&Sample) -> Option<u64>) -> Option<Trend> {
    let quarter = samples.len() / 4;
    let median = |from: usize| {
        let mut values: Vec<u64> = samples[from..from + quarter].iter().filter_map(get).collect();
        values.sort_unstable();
        values.get(values.len() / 2).copied()
    };
    let second_quarter = median(quarter)?;
    let last_quarter = median(samples.len() - quarter)?;
    let growth = last_quarter as f64 / second_quarter.max(1) as f64 - 1.0;
    Some(Trend { second_quarter, last_quarter, growth })
}

impl fmt::Display for MemoryReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "memory, second quarter to last:")?;
        let named = [("process", self.anonymous), ("front", self.front), ("pager", self.pager)];
        let mut separator = "";
        for (name, trend) in named {
            if let Some(Trend { second_quarter, last_quarter, growth }) = trend {
                let [before, after] = [second_quarter, last_quarter].map(text::size);
                let percent = 100.0 * growth;
                write!(f, "{separator} {name} {before} to {after} ({percent:+.1} %)")?;
                separator = ",";
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_trend_is_from_the_second_quarter_to_the_last() {
        let sample = |front| Sample { front, ..Sample::default() };
        let samples: Vec<_> = (0..60).map(|i| sample(if i < 45 { 100 } else { 103 })).collect();
        let front = trend(&samples, |sample| Some(sample.front as u64)).expect("it was sampled");
        assert_eq!((front.second_quarter, front.last_quarter), (100, 103));
        assert!((front.growth - 0.03).abs() < 1e-9);
        assert!(trend(&samples, |_| None).is_none());
        assert!(trend(&samples[..3], |sample| Some(sample.front as u64)).is_none());
    }
}
