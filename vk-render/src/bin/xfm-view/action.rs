//! What a key, a button or a gesture can ask for.

use crate::camera::standard::Standard;
use crate::state::Look;

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Action {
    Fit,
    Stand(Standard),
    OtherUp,
    Fly,
    Finer,
    Coarser,
    NextLook,
    Look(Look),
    /// Keeps the detail for where the camera is now, or lets it follow again.
    Freeze,
    /// Goes where a frozen camera and its model are seen from outside.
    Outside,
    Section,
    /// The section's plane faces the eye from now on.
    SectionFromHere,
    Measure,
    Screenshot,
    ScreenshotWithPanels,
    Record,
    Replay,
    CopyView,
    PasteView,
    Controls,
    Numbers,
    HidePanels,
    Help,
    FullScreen,
    /// Leaves what is open, one thing after another.
    Leave,
    Quit,
    /// Soft and hard, in bytes.
    Quotas([usize; 2]),
    CancelOpening,
    DismissNotice(String),
}
