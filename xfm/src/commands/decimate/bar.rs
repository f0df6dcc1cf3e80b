//! How far a decimation is, for people who watch.

use stream_decimate::Stage;

use crate::progress::{Progress, Unit};

/// The progress bar of the stage a run is in.
#[derive(Default)]
pub(super) struct Bar(Option<(Stage, Progress)>);

impl Bar {
    fn at(&mut self, stage: Stage, total: Option<u64>) -> &Progress {
        if self.0.as_ref().is_none_or(|shown| shown.0 != stage) {
            let task = match stage {
                Stage::Counting => "counting",
                Stage::Sorting => "sorting",
                _ => "decimating",
            };
            // The old one goes before the new one comes.
            self.0 = None;
            self.0 = Some((stage, Progress::new(task, total, Unit::Items)));
        }
        let (_, bar) = self.0.as_ref().expect("just made");
        if let Some(total) = total {
            bar.set_total(total);
        }
        bar
    }

    /// Triangles read, how full the buffer is, and the share of the triangles that it has kept.
    pub(super) fn show_stream(&mut self, progress: &stream_decimate::Progress) {
        let bar = self.at(progress.stage, progress.expected);
        bar.set(progress.read);
        if progress.stage == Stage::Decimating && progress.capacity > 0 {
            let filled = 100 * progress.buffered / progress.capacity;
            let level = 100.0 * progress.resolution;
            bar.describe(format!("decimating (buffer {filled} %, resolution {level:.1} %)"));
        }
    }

    /// Triangles that are gone of those that have to go.
    pub(super) fn show_greedy(&mut self, progress: &stream_decimate::Progress, target: u64) {
        let bar = self.at(progress.stage, Some(progress.capacity.saturating_sub(target)));
        bar.set(progress.capacity.saturating_sub(progress.buffered));
    }
}
