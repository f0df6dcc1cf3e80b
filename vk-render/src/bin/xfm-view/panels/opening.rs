//! What is shown while a file is being opened, and where there is none.

use egui::{Align2, Context, ProgressBar, RichText, Window};

use crate::action::Action;
use crate::panels::{Facts, style, words};

pub(super) fn show(context: &Context, facts: &Facts<'_>, asked: &mut Vec<Action>) {
    let anchor = |name: &str| {
        Window::new(name.to_owned())
            .title_bar(false)
            .resizable(false)
            .order(egui::Order::Foreground)
            .anchor(Align2::CENTER_CENTER, [0.0, 0.0])
    };
    if facts.hovering {
        anchor("drop").show(context, |ui| ui.heading("Drop the file to look at it"));
        return;
    }
    let Some(opening) = facts.opening else {
        if facts.model.is_none() {
            anchor("welcome").show(context, |ui| {
                ui.heading("Drop a file here");
                let text = "A .xfm file, or a mesh: STL, PLY, OBJ, glTF; .gz and .zst too";
                ui.add(egui::Label::new(text).extend());
            });
        }
        return;
    };
    let (stage, done, share) = opening.progress.read();
    // Opening again for other quotas is nothing to look at.
    if facts.model.is_some() && stage == "opening" {
        return;
    }
    anchor("opening").show(context, |ui| {
        ui.set_width(360.0);
        let name = opening.source.file_name().unwrap_or_default().to_string_lossy();
        ui.heading(name);
        ui.add(match share {
            Some(share) => ProgressBar::new(share).show_percentage(),
            None => ProgressBar::new(0.0),
        });
        ui.horizontal(|ui| {
            let text =
                if done > 0 { format!("{stage} {}", words::count(done)) } else { stage.into() };
            ui.label(RichText::new(text).color(style::FAINT));
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                if ui.button("Cancel").clicked() {
                    asked.push(Action::CancelOpening);
                }
            });
        });
    });
}
