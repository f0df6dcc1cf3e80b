//! How often checkpoints are made: as often as the time they take allows. What is built does not depend on it.

use std::time::{Duration, Instant};

/// Of the time they take one fiftieth, two percent.
const SHARE: u32 = 50;
/// They are no closer together.
const LEAST: Duration = Duration::from_secs(5);
/// Bytes per second that are written, before any have been.
const RATE: f64 = 400e6;

#[derive(Debug)]
pub(crate) struct Pace {
    /// Where it is asked for, the time between two.
    every: Option<Duration>,
    start: Instant,
    last: Instant,
    spent: Duration,
    /// Bytes per second at the last one.
    rate: f64,
}

impl Pace {
    pub fn new(every: Option<Duration>) -> Self {
        let start = Instant::now();
        Self { every, start, last: start, spent: Duration::ZERO, rate: RATE }
    }

    /// Whether a checkpoint of so many bytes can be afforded.
    pub fn is_due(&self, bytes: u64) -> bool {
        let next = Duration::try_from_secs_f64(bytes as f64 / self.rate).unwrap_or(Duration::MAX);
        self.is_due_after(self.start.elapsed(), self.last.elapsed(), next)
    }

    fn is_due_after(&self, all: Duration, since: Duration, next: Duration) -> bool {
        match self.every {
            Some(every) => since >= every,
            None => since >= LEAST && self.spent.saturating_add(next) <= all / SHARE,
        }
    }

    /// Notes that a checkpoint of so many bytes has been made in this time.
    pub fn made(&mut self, bytes: u64, taken: Duration) {
        self.last = Instant::now();
        self.spent += taken;
        self.rate = (bytes as f64 / taken.as_secs_f64().max(1e-3)).max(1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checkpoints_take_a_fiftieth_of_the_time() {
        let seconds = Duration::from_secs_f64;
        let mut pace = Pace::new(None);
        // A second each, looked at once a second.
        let (mut last, mut made) = (0, 0);
        for now in 0..10_000 {
            if pace.is_due_after(seconds(now.into()), seconds((now - last).into()), seconds(1.0)) {
                pace.spent += seconds(1.0);
                (last, made) = (now, made + 1);
            }
            assert!(made * 50 <= now);
        }
        assert_eq!(made, 199);
        // And as often as is asked for, whatever it takes.
        let mut pace = Pace::new(Some(Duration::ZERO));
        assert!(pace.is_due(u64::MAX));
        pace.made(u64::MAX, seconds(1e6));
        assert!(pace.is_due(u64::MAX));
    }
}
