//! The panel on the right: what the last frame showed and took, as in Table 3 of the first paper.

use egui::{Align2, Color32, Context, Grid, ProgressBar, Rect, RichText, Sense, Ui, Window, vec2};

use crate::model::Numbers;
use crate::panels::words::{count, ms, size};
use crate::panels::{Facts, style};
use crate::state::{History, State};

const WIDTH: f32 = 212.0;
const PLOT_HEIGHT: f32 = 44.0;

pub(super) fn show(context: &Context, state: &State, facts: &Facts<'_>) {
    let Some(numbers) = facts.numbers else { return };
    Window::new("Numbers")
        .title_bar(false)
        .resizable(false)
        .anchor(Align2::RIGHT_TOP, [-8.0, 8.0])
        .constrain_to(context.available_rect())
        .show(context, |ui| {
            ui.set_width(WIDTH);
            // Room for the line at the bottom.
            let height = context.available_rect().height() - 80.0;
            egui::ScrollArea::vertical().max_height(height).min_scrolled_height(height).show(
                ui,
                |ui| {
                    frame_time(ui, &state.history);
                    plot(ui, &state.history);
                    let input = facts.model.map_or(0, |model| model.input_triangles);
                    Grid::new("numbers")
                        .num_columns(2)
                        .min_col_width(96.0)
                        .spacing([8.0, 3.0])
                        .show(ui, |ui| {
                            shown(ui, numbers, input);
                            ui.end_row();
                            detail(ui, numbers);
                            ui.end_row();
                            times(ui, numbers, &state.history);
                        });
                    memory(ui, numbers);
                    ui.label(RichText::new(facts.device).small().color(style::FAINT));
                },
            );
        });
}

fn row(ui: &mut Ui, name: &str, value: String, words: &str) {
    row_in(ui, name, value, words, style::TEXT);
}

fn row_in(ui: &mut Ui, name: &str, value: String, words: &str, colour: Color32) {
    ui.label(RichText::new(name).color(style::FAINT)).on_hover_text(words);
    ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
        ui.label(RichText::new(value).monospace().color(colour)).on_hover_text(words);
    });
    ui.end_row();
}

fn frame_time(ui: &mut Ui, history: &History) {
    let whole = history.last().map_or(0.0, |frame| frame.whole.as_secs_f64());
    ui.horizontal(|ui| {
        ui.label(RichText::new("Frame").strong());
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            let rate = if whole > 0.0 { (1.0 / whole).min(9999.0) } else { 0.0 };
            let text = format!("{:.1} ms  {rate:>4.0}/s", 1e3 * whole);
            ui.label(RichText::new(text).monospace()).on_hover_text("Time of the last frame");
        });
    });
}

/// A bar per frame, the newest on the right: the whole of it, and within it updates and upload.
fn plot(ui: &mut Ui, history: &History) {
    let (rect, response) = ui.allocate_exact_size(vec2(WIDTH, PLOT_HEIGHT), Sense::hover());
    response.on_hover_text(
        "Times of the last 120 frames: grey all of it, blue the detail's update, amber the upload",
    );
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, 2.0, Color32::from_rgb(20, 22, 27));
    // The scale goes in steps, so that it does not wobble.
    let mut sorted: Vec<f32> = history.frames().map(|f| f.whole.as_secs_f32()).collect();
    sorted.sort_by(f32::total_cmp);
    // A frame out of twenty may stick out: the first ones do.
    let longest = sorted.get((sorted.len() * 19 / 20).min(sorted.len().saturating_sub(2)));
    let longest = longest.copied().unwrap_or(0.0);
    let top =
        [0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0].into_iter().find(|&t| longest <= t).unwrap_or(5.0);
    let width = WIDTH / History::MOST as f32;
    let height = |seconds: f32| PLOT_HEIGHT * (seconds / top).min(1.0);
    let first = History::MOST - history.frames().len();
    for (i, frame) in history.frames().enumerate() {
        let left = rect.left() + width * (first + i) as f32;
        let bar = |bottom: f32, seconds: f32, colour| {
            let tall = height(seconds);
            let min = egui::pos2(left, rect.bottom() - bottom - tall);
            painter.rect_filled(Rect::from_min_size(min, vec2(width, tall)), 0.0, colour);
            bottom + tall
        };
        bar(0.0, frame.whole.as_secs_f32(), Color32::from_rgb(86, 92, 104));
        let update = bar(0.0, frame.update.as_secs_f32(), style::ACCENT);
        bar(update, frame.upload.as_secs_f32(), style::WARN);
    }
    let text = format!("{:.0} ms", 1e3 * top);
    let font = egui::FontId::proportional(10.5);
    painter.text(rect.left_top() + vec2(4.0, 2.0), Align2::LEFT_TOP, text, font, style::FAINT);
}

fn shown(ui: &mut Ui, numbers: &Numbers, input: u64) {
    row(
        ui,
        "triangles",
        count(numbers.triangles_shown as u64),
        "Triangles of the mesh that is drawn",
    );
    row(ui, "of all", count(input), "Triangles of the whole model");
    let words = "What is drawn is wrong by no more than so many pixels, where all detail is there";
    row(ui, "pixel error", format!("{:.2} px", numbers.tolerance_px), words);
}

fn detail(ui: &mut Ui, numbers: &Numbers) {
    row(ui, "updates", count(numbers.updates as u64), "Splits and collapses in the last frame");
    row(ui, "tests", count(numbers.tests as u64), "Nodes that were tested against the view");
    let blocks = count(numbers.resident_blocks as u64);
    row(ui, "blocks", blocks, "Blocks of the file that are in memory");
    row(
        ui,
        "loaded",
        format!("+{}", count(numbers.blocks_loaded)),
        "Blocks loaded in the last frame",
    );
    let hits =
        numbers.hit_rate().map_or_else(|| "–".into(), |share| format!("{:.1} %", 100.0 * share));
    row(ui, "cache hits", hits, "Share of the nodes looked at that were in memory");
    row(
        ui,
        "queue",
        count(numbers.queue as u64),
        "Pages of the file that were asked for and are to come",
    );
    row(
        ui,
        "waiting",
        count(numbers.waiting as u64),
        "Places that would be finer if that detail were there",
    );
    if numbers.damaged_pages > 0 {
        let pages = count(numbers.damaged_pages as u64);
        row_in(
            ui,
            "damaged pages",
            pages,
            "They cannot be read; their detail is not shown",
            style::BAD,
        );
    }
}

fn times(ui: &mut Ui, numbers: &Numbers, history: &History) {
    row(ui, "view tests", ms(numbers.test_time), "Time for tests against the view");
    row(ui, "updates", ms(numbers.update_time), "Time for splits and collapses");
    row(
        ui,
        "handover",
        ms(numbers.handover_time),
        "Time for taking blocks over and letting others go",
    );
    row(ui, "loading", ms(numbers.load_time), "Time of the threads that read, beside the frames");
    let upload = history.last().map_or_else(Default::default, |frame| frame.upload);
    row(ui, "upload", ms(upload), "Time to send what changed to the device");
}

fn memory(ui: &mut Ui, numbers: &Numbers) {
    let share = numbers.resident_bytes as f32 / numbers.hard_quota.max(1) as f32;
    let text = format!("{} of {}", size(numbers.resident_bytes), size(numbers.hard_quota));
    let colour = if numbers.short_of_memory || numbers.resident_bytes > numbers.soft_quota {
        Color32::from_rgb(150, 96, 30)
    } else {
        Color32::from_rgb(38, 92, 140)
    };
    let bar = ProgressBar::new(share)
        .text(RichText::new(text).monospace())
        .fill(colour)
        .corner_radius(3.0);
    ui.add(bar).on_hover_text(format!(
        "Memory for detail, of what is never exceeded. Above {} what is not shown is let go.",
        size(numbers.soft_quota)
    ));
    if numbers.short_of_memory {
        let text = RichText::new("memory is used up: coarser").color(style::WARN);
        ui.label(text).on_hover_text("Raise the limit of memory for detail to see it finer");
    }
}
