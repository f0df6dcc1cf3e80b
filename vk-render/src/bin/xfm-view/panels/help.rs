//! All keys and gestures, from the one table there is.

use egui::{Align2, Context, Grid, RichText, Ui, Window};

use crate::action::Action;
use crate::input::keys::{Binding, GESTURES, GROUPS};
use crate::panels::style;

pub(super) fn show(context: &Context, asked: &mut Vec<Action>) {
    let mut open = true;
    let room = context.available_rect();
    Window::new("Keys and mouse")
        .open(&mut open)
        .collapsible(false)
        .resizable(false)
        .anchor(Align2::CENTER_CENTER, [0.0, 16.0])
        .constrain_to(room)
        .order(egui::Order::Foreground)
        .show(context, |ui| {
            // As large as what is in it, and no larger than the window.
            let height = room.height() - 70.0;
            let width = room.width() - 40.0;
            ui.set_max_width(width);
            egui::ScrollArea::both()
                .max_height(height)
                .max_width(width)
                .min_scrolled_height(height)
                .min_scrolled_width(width)
                .show(ui, columns);
        });
    if !open {
        asked.push(Action::Help);
    }
}

fn columns(ui: &mut Ui) {
    ui.horizontal_top(|ui| {
        let [look, detail, tools, window] = GROUPS;
        ui.vertical(|ui| {
            group(ui, "Mouse, touchpad, walking", GESTURES);
            bindings(ui, window);
        });
        ui.add_space(20.0);
        ui.vertical(|ui| {
            bindings(ui, look);
            bindings(ui, detail);
        });
        ui.add_space(20.0);
        ui.vertical(|ui| bindings(ui, tools));
    });
}

fn bindings(ui: &mut Ui, (name, bindings): (&'static str, &[Binding])) {
    group(ui, name, bindings.iter().map(|b| (b.keys[0], b.words)));
}

fn group<'a>(ui: &mut Ui, name: &str, rows: impl IntoIterator<Item = (&'a str, &'a str)>) {
    ui.label(RichText::new(name).strong().color(style::ACCENT));
    Grid::new(name).num_columns(2).spacing([14.0, 2.0]).show(ui, |ui| {
        for (keys, words) in rows {
            ui.add(egui::Label::new(RichText::new(keys).monospace()).extend());
            ui.add(egui::Label::new(words).extend());
            ui.end_row();
        }
    });
    ui.add_space(6.0);
}
