//! What decides how fine the picture is.

use std::time::Duration;

use crate::model::Detail;

/// What is held; the rest follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum By {
    #[default]
    Pixels,
    Triangles,
    Time,
}

impl By {
    /// For programs.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Pixels => "pixels",
            Self::Triangles => "triangles",
            Self::Time => "time",
        }
    }
}

/// Which of them, and how much of each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DetailChoice {
    pub(crate) by: By,
    /// Error on the screen.
    pub(crate) pixels: f32,
    /// Number of triangles.
    pub(crate) budget: usize,
    /// Time of a frame in milliseconds.
    pub(crate) frame_ms: f32,
    /// Whether vertices glide to their places.
    pub(crate) glides: bool,
}

impl Default for DetailChoice {
    fn default() -> Self {
        Self { by: By::Pixels, pixels: 1.0, budget: 500_000, frame_ms: 50.0, glides: false }
    }
}

impl DetailChoice {
    /// Least and largest error in pixels.
    pub(crate) const PIXELS: [f32; 2] = [0.1, 100.0];
    /// Least and largest number of triangles.
    pub(crate) const BUDGET: [usize; 2] = [1_000, 50_000_000];
    /// Least and largest time of a frame.
    pub(crate) const FRAME_MS: [f32; 2] = [4.0, 500.0];

    pub(crate) fn detail(&self) -> Detail {
        match self.by {
            By::Pixels => Detail::Pixels(self.pixels),
            By::Triangles => Detail::Budget(self.budget),
            By::Time => Detail::FrameTime(Duration::from_secs_f64(f64::from(self.frame_ms) / 1e3)),
        }
    }

    /// Finer by a factor below one, coarser by one above.
    pub(crate) fn scale(&mut self, factor: f32) {
        let within = |value: f32, [least, most]: [f32; 2]| value.clamp(least, most);
        match self.by {
            By::Pixels => self.pixels = within(self.pixels * factor, Self::PIXELS),
            By::Triangles => {
                let budget = (self.budget as f32 / factor) as usize;
                self.budget = budget.clamp(Self::BUDGET[0], Self::BUDGET[1]);
            }
            By::Time => self.frame_ms = within(self.frame_ms / factor, Self::FRAME_MS),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finer_is_finer_whatever_is_held_and_ends_somewhere() {
        let mut choice = DetailChoice::default();
        choice.scale(0.5);
        assert_eq!(choice.detail(), Detail::Pixels(0.5));
        choice.by = By::Triangles;
        choice.scale(0.5);
        assert_eq!(choice.detail(), Detail::Budget(1_000_000));
        choice.by = By::Time;
        choice.scale(0.5);
        assert_eq!(choice.detail(), Detail::FrameTime(Duration::from_millis(100)));
        (0..100).for_each(|_| choice.scale(2.0));
        assert_eq!(choice.frame_ms, DetailChoice::FRAME_MS[0]);
    }
}
