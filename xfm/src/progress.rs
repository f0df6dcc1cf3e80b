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
    unit: Unit,
}

impl Progress {
    /// Shows a bar for `total` units, or a counter where the total is not known.
    pub fn new(task: &'static str, total: Option<u64>, unit: Unit) -> Self {
        let bar = match total {
            Some(total) => ProgressBar::new(total),
            None => ProgressBar::no_length(),
        };
        bar.set_style(style(total, unit));
        bar.set_message(task);
        bar.enable_steady_tick(Duration::from_millis(100));
        Self { bar, unit }
    }

    /// The total became known.
    pub fn set_total(&self, total: u64) {
        if self.bar.length() != Some(total) {
            self.bar.set_style(style(Some(total), self.unit));
            self.bar.set_length(total);
        }
    }

    /// Says more about what is going on than the task's name.
    pub fn describe(&self, task: String) {
        self.bar.set_message(task);
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

/// A bar with the time left where the total is known, a spinner where it is not.
fn style(total: Option<u64>, unit: Unit) -> ProgressStyle {
    let (position, length, rate) = match unit {
        Unit::Items => ("{human_pos}", "{human_len}", "{per_sec}"),
        Unit::Bytes => ("{binary_bytes}", "{binary_total_bytes}", "{binary_bytes_per_sec}"),
    };
    let template = match total {
        Some(_) => format!("{{msg}} {{wide_bar}} {position}/{length} {rate}, {{eta}} left"),
        None => format!("{{msg}} {{spinner}} {position} {rate}"),
    };
    // The templates above are fixed and right; were one not, the default would do.
    ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar())
}
