//! The panels over the picture: what they show, and what is asked for in them.

mod bar;
mod controls;
mod help;
mod labels;
mod numbers;
mod opening;
pub(crate) mod style;
mod words;

use glam::DVec3;

use crate::action::Action;
use crate::model::{Model, Numbers, Opening};
use crate::state::State;

/// What panels show besides the state.
#[derive(Clone, Copy)]
pub(crate) struct Facts<'a> {
    pub(crate) model: Option<&'a Model>,
    pub(crate) opening: Option<&'a Opening>,
    pub(crate) numbers: Option<&'a Numbers>,
    pub(crate) device: &'a str,
    /// Whether a file is held over the window.
    pub(crate) hovering: bool,
}

impl Facts<'_> {
    fn origin(&self) -> DVec3 {
        self.model.map_or(DVec3::ZERO, |model| model.origin)
    }

    fn has_colours(&self) -> bool {
        self.model.is_some_and(Model::has_colours)
    }
}

/// In a window of fewer points the numbers would hide the model.
const LEAST_FOR_NUMBERS: f32 = 600.0;

/// Lays out all panels and paints labels into the picture.
pub(crate) fn show(context: &egui::Context, state: &mut State, facts: Facts<'_>) -> Vec<Action> {
    let mut asked = Vec::new();
    labels::points(context, state, facts.origin());
    if state.panels.hidden {
        labels::notices(context, state, labels::BOTTOM, &mut asked);
        return asked;
    }
    bar::show(context, state, &facts, &mut asked);
    if facts.model.is_some() {
        if state.panels.controls {
            controls::show(context, state, &facts, &mut asked);
        }
        if state.panels.numbers && context.content_rect().width() > LEAST_FOR_NUMBERS {
            numbers::show(context, state, &facts);
        }
        labels::legend(context, state);
    }
    let bottom = labels::status(context, state);
    labels::notices(context, state, bottom, &mut asked);
    labels::hint(context, state, &facts);
    opening::show(context, &facts, &mut asked);
    if state.panels.help {
        help::show(context, &mut asked);
    }
    asked
}
