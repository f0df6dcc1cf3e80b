//! Progress bars: on standard error, and only when that is a terminal.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// What a bar counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Things, by number.
    Items,
    /// Bytes.
    Bytes,
}

/// A bar that goes away when dropped.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
}

impl Progress {
    /// Shows a bar for `total` units, or a counter where the total is not known.
    pub fn new(task: &'static str, total: Option<u64>, unit: Unit) -> Self {
        let (position, length, rate) = match unit {
            Unit::Items => ("{human_pos}", "{human_len}", "{per_sec}"),
            Unit::Bytes => ("{binary_bytes}", "{binary_total_bytes}", "{binary_bytes_per_sec}"),
        };
        let (bar, template) = match total {
            Some(total) => (
                ProgressBar::new(total),
                format!("{{msg}} {{wide_bar}} {position}/{length} {rate}, {{eta}} left"),
            ),
            None => (ProgressBar::no_length(), format!("{{msg}} {{spinner}} {position} {rate}")),
        };
        // The templates above are fixed; were one wrong, the bar's default would do.
        if let Ok(style) = ProgressStyle::with_template(&template) {
            bar.set_style(style);
        }
        bar.set_message(task);
        bar.enable_steady_tick(Duration::from_millis(100));
        Self { bar }
    }

    /// So many more are done.
    pub fn advance(&self, units: u64) {
        self.bar.inc(units);
    }

    /// So many are done in all.
    pub fn set(&self, units: u64) {
        self.bar.set_position(units);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
