//! The bar on top: what can be done, by name.

use egui::{Align, Button, Context, Layout, RichText, TopBottomPanel, Ui};

use crate::action::Action;
use crate::camera::standard::{Standard, Up};
use crate::panels::{Facts, style};
use crate::state::State;

type Asked = Vec<Action>;

/// A window of fewer points has the bar in two lines.
const NARROW: f32 = 860.0;

pub(super) fn show(context: &Context, state: &State, facts: &Facts<'_>, asked: &mut Asked) {
    let margin = egui::Margin::symmetric(8, 5);
    let frame = egui::Frame::side_top_panel(&context.style()).inner_margin(margin);
    let narrow = context.content_rect().width() < NARROW;
    TopBottomPanel::top("bar").frame(frame).show_separator_line(false).show(context, |ui| {
        if narrow {
            ui.horizontal_wrapped(|ui| {
                ui.add_enabled_ui(facts.model.is_some(), |ui| tools(ui, state, asked));
            });
            ui.horizontal_wrapped(|ui| panels(ui, state, facts, asked));
            return;
        }
        ui.horizontal(|ui| {
            ui.add_enabled_ui(facts.model.is_some(), |ui| tools(ui, state, asked));
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                panels(ui, state, facts, asked);
            });
        });
    });
}

/// A button, lit while what it stands for is on.
fn tool(ui: &mut Ui, on: bool, (name, words): (&str, &str), action: Action, asked: &mut Asked) {
    let button = Button::selectable(on, name).frame_when_inactive(true);
    if ui.add(button).on_hover_text(words).clicked() {
        asked.push(action);
    }
}

fn tools(ui: &mut Ui, state: &State, asked: &mut Asked) {
    tool(ui, false, ("Fit", "The whole model (F)"), Action::Fit, asked);
    ui.menu_button("Views", |ui| views(ui, state, asked));
    let words = "Look about with the mouse, walk with W A S D, Q E (G)";
    tool(ui, state.fly, ("Fly", words), Action::Fly, asked);
    ui.separator();
    tool(
        ui,
        state.measure.on,
        ("Measure", "Click points on the surface (T)"),
        Action::Measure,
        asked,
    );
    tool(ui, state.section.on, ("Section", "Cut the model open (X)"), Action::Section, asked);
    let words = "Keep the detail as it is and look at it from elsewhere (L)";
    tool(ui, state.frozen.is_some(), ("Freeze", words), Action::Freeze, asked);
    if state.frozen.is_some() {
        let words = "Go where camera and model are seen from outside (O)";
        tool(ui, false, ("Outside", words), Action::Outside, asked);
    }
    ui.separator();
    let words = "A PNG in the current folder (P; with panels Shift+P)";
    tool(ui, false, ("Screenshot", words), Action::Screenshot, asked);
    let words = "Record a camera path, and end it (R)";
    tool(ui, state.recording.is_some(), ("Record", words), Action::Record, asked);
    if state.last_path.is_some() {
        let words = "The path that was recorded or given (Y)";
        tool(ui, state.replay.is_some(), ("Replay", words), Action::Replay, asked);
    }
}

fn views(ui: &mut Ui, state: &State, asked: &mut Asked) {
    let mut entry = |ui: &mut Ui, name: &str, key: &str, action: Action| {
        if ui.add(Button::new(name).shortcut_text(key)).clicked() {
            asked.push(action);
        }
    };
    for (view, key) in Standard::ALL.into_iter().zip(["1", "2", "3", "4", "5", "6"]) {
        entry(ui, view.name(), key, Action::Stand(view));
    }
    ui.separator();
    let up = if state.navigator.up() == Up::Y { "Z upwards" } else { "Y upwards" };
    entry(ui, up, "U", Action::OtherUp);
    ui.separator();
    entry(ui, "Copy view", "Ctrl+C", Action::CopyView);
    entry(ui, "Paste view", "Ctrl+V", Action::PasteView);
}

fn panels(ui: &mut Ui, state: &State, facts: &Facts<'_>, asked: &mut Asked) {
    tool(ui, state.panels.help, ("Help", "All keys (? or F1)"), Action::Help, asked);
    if let Some(model) = facts.model {
        let words = "Triangles, memory, times (N)";
        tool(ui, state.panels.numbers, ("Numbers", words), Action::Numbers, asked);
        let words = "Detail, shading, section, memory (C)";
        tool(ui, state.panels.controls, ("Controls", words), Action::Controls, asked);
        if ui.available_width() > 90.0 {
            let name = model.source.file_name().unwrap_or_default().to_string_lossy();
            let label = egui::Label::new(RichText::new(name).color(style::FAINT)).truncate();
            ui.add(label).on_hover_text(model.source.display().to_string());
        }
    }
}
