//! Short messages in the window.

use std::time::Duration;

/// What is said, and how.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Notice {
    pub(crate) text: String,
    pub(crate) is_error: bool,
    left: Duration,
    /// Not seen yet: what passed before it was said does not count.
    fresh: bool,
}

/// Those that are shown, the oldest first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Notices {
    shown: Vec<Notice>,
}

impl Notices {
    const MOST: usize = 4;

    pub(crate) fn say(&mut self, text: impl Into<String>) {
        self.add(text.into(), false, Duration::from_secs(5));
    }

    pub(crate) fn complain(&mut self, text: impl Into<String>) {
        self.add(text.into(), true, Duration::from_secs(30));
    }

    fn add(&mut self, text: String, is_error: bool, left: Duration) {
        self.shown.retain(|notice| notice.text != text);
        if self.shown.len() >= Self::MOST {
            self.shown.remove(0);
        }
        self.shown.push(Notice { text, is_error, left, fresh: true });
    }

    /// Lets time pass.
    pub(crate) fn step(&mut self, passed: Duration) {
        self.shown.retain_mut(|notice| {
            if !std::mem::take(&mut notice.fresh) {
                notice.left = notice.left.saturating_sub(passed);
            }
            !notice.left.is_zero()
        });
    }

    pub(crate) fn dismiss(&mut self, text: &str) {
        self.shown.retain(|notice| notice.text != text);
    }

    pub(crate) fn shown(&self) -> &[Notice] {
        &self.shown
    }
}
