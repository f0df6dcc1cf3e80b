//! The panel on the left: how fine, how coloured, cut where, in how much memory.

use egui::{Align2, Context, RichText, Slider, Ui, Window};

use crate::action::Action;
use crate::panels::{Facts, style, words};
use crate::state::{Axis, By, DetailChoice, Look, State};

const WIDTH: f32 = 236.0;

pub(super) fn show(
    context: &Context,
    state: &mut State,
    facts: &Facts<'_>,
    asked: &mut Vec<Action>,
) {
    Window::new("Controls")
        .title_bar(false)
        .resizable(false)
        .anchor(Align2::LEFT_TOP, [8.0, 8.0])
        .constrain_to(context.available_rect())
        .show(context, |ui| {
            ui.set_width(WIDTH);
            let height = context.available_rect().height() - 80.0;
            egui::ScrollArea::vertical().max_height(height).min_scrolled_height(height).show(
                ui,
                |ui| {
                    detail(ui, state);
                    ui.separator();
                    look(ui, state, facts, asked);
                    if state.section.on {
                        ui.separator();
                        section(ui, state, asked);
                    }
                    if state.measure.on {
                        ui.separator();
                        measure(ui, state, facts);
                    }
                    ui.separator();
                    memory(ui, state, facts, asked);
                },
            );
        });
}

fn heading(ui: &mut Ui, text: &str) {
    ui.label(RichText::new(text).strong());
}

fn detail(ui: &mut Ui, state: &mut State) {
    heading(ui, "Detail");
    let choice = &mut state.detail;
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        for (by, name, words) in [
            (By::Pixels, "Pixel error", "As fine as this error on the screen asks for (+ and −)"),
            (By::Triangles, "Triangles", "So many triangles are held; the error follows (+ and −)"),
            (By::Time, "Time", "Frames take so long; the error follows (+ and −)"),
        ] {
            ui.selectable_value(&mut choice.by, by, name).on_hover_text(words);
        }
    });
    let slider = match choice.by {
        By::Pixels => {
            let [least, most] = DetailChoice::PIXELS;
            Slider::new(&mut choice.pixels, least..=most).suffix(" px")
        }
        By::Triangles => {
            let [least, most] = DetailChoice::BUDGET;
            Slider::new(&mut choice.budget, least..=most)
                .custom_formatter(|n, _| short(n))
                .custom_parser(parse_short)
        }
        By::Time => {
            let [least, most] = DetailChoice::FRAME_MS;
            Slider::new(&mut choice.frame_ms, least..=most).suffix(" ms").fixed_decimals(0)
        }
    };
    let words = match choice.by {
        By::Pixels => "To the left finer, to the right coarser",
        By::Triangles => "To the left fewer triangles, to the right more",
        By::Time => "To the left faster and coarser, to the right slower and finer",
    };
    ui.add(slider.logarithmic(true)).on_hover_text(words);
    ui.checkbox(&mut choice.glides, "vertices glide to their places")
        .on_hover_text("Detail comes and goes over a few frames instead of at once");
}

fn look(ui: &mut Ui, state: &State, facts: &Facts<'_>, asked: &mut Vec<Action>) {
    heading(ui, "Shading");
    let shown = Look::ALL.into_iter().filter(|&look| look != Look::Own || facts.has_colours());
    ui.columns(2, |columns| {
        for (i, look) in shown.enumerate() {
            let ui = &mut columns[i % 2];
            let label = ui.selectable_label(state.look == look, look.name());
            if label.on_hover_text(look.words()).clicked() {
                asked.push(Action::Look(look));
            }
        }
    });
}

fn section(ui: &mut Ui, state: &mut State, asked: &mut Vec<Action>) {
    heading(ui, "Section");
    let tool = &mut state.section;
    ui.horizontal(|ui| {
        for axis in Axis::ALL {
            if ui.selectable_label(tool.axis == axis, axis.name()).clicked() {
                tool.axis = axis;
                if axis == Axis::View {
                    asked.push(Action::SectionFromHere);
                }
            }
        }
        ui.checkbox(&mut tool.flipped, "other side");
    });
    ui.add(
        Slider::new(&mut tool.depth, 0.0..=1.0)
            .custom_formatter(|n, _| format!("{:.0} %", 100.0 * n)),
    )
    .on_hover_text("How much is cut away");
}

fn measure(ui: &mut Ui, state: &mut State, facts: &Facts<'_>) {
    heading(ui, "Measure");
    let radius = state.radius();
    if state.measure.points.is_empty() {
        ui.label(RichText::new("Click a point on the surface").color(style::FAINT));
    }
    for (name, point) in ["A", "B"].into_iter().zip(&state.measure.points) {
        ui.horizontal(|ui| {
            ui.label(RichText::new(name).color(style::ACCENT).strong());
            let text = crate::state::position_text(*point, facts.origin(), radius);
            let text = RichText::new(text).monospace().size(11.0);
            ui.add(egui::Label::new(text).selectable(true).wrap());
        });
    }
    if let Some(distance) = state.measure.distance() {
        let text = format!("distance {}", crate::state::length_text(distance, radius));
        ui.add(egui::Label::new(RichText::new(text).monospace().strong()).selectable(true));
    }
}

fn memory(ui: &mut Ui, state: &mut State, facts: &Facts<'_>, asked: &mut Vec<Action>) {
    heading(ui, "Memory for detail");
    const RANGE: std::ops::RangeInclusive<f64> = 1.0..=65536.0;
    let [mut soft, mut hard] = state.quotas.map(words::mib);
    let before = [soft, hard];
    let slider = |ui: &mut Ui, value: &mut f64, name: &str, words_: &str| {
        ui.horizontal(|ui| {
            ui.spacing_mut().slider_width = 112.0;
            let slider = Slider::new(value, RANGE)
                .logarithmic(true)
                .custom_formatter(|n, _| words::size((n * f64::from(1 << 20)) as usize));
            let response = ui.add(slider).on_hover_text(words_);
            ui.label(name);
            response.drag_stopped() || response.lost_focus()
        })
        .inner
    };
    let words_soft = "Above this, detail that is not shown is let go";
    let words_hard = "This is never exceeded: what would is not loaded";
    // Both are drawn, whatever comes of the first.
    let done =
        [slider(ui, &mut soft, "kept", words_soft), slider(ui, &mut hard, "limit", words_hard)];
    if soft != before[0] {
        hard = hard.max(soft);
    } else if hard != before[1] {
        soft = soft.min(hard);
    }
    state.quotas = [soft, hard].map(|mib| (mib * f64::from(1 << 20)) as usize);
    let in_force = facts.numbers.map(|numbers| [numbers.soft_quota, numbers.hard_quota]);
    if done.contains(&true) && in_force.is_some_and(|in_force| in_force != state.quotas) {
        asked.push(Action::Quotas(state.quotas));
    }
}

/// A count with a unit, as 250 k.
fn short(number: f64) -> String {
    if number >= 1e6 { format!("{:.2} M", number / 1e6) } else { format!("{:.0} k", number / 1e3) }
}

fn parse_short(text: &str) -> Option<f64> {
    let text = text.trim().to_lowercase();
    let (digits, unit) = match text.strip_suffix(['k', 'm']) {
        Some(digits) if text.ends_with('k') => (digits, 1e3),
        Some(digits) => (digits, 1e6),
        None => (text.as_str(), 1.0),
    };
    digits.trim().replace(',', "").parse::<f64>().ok().map(|number| number * unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn budgets_are_written_and_read_with_units() {
        assert_eq!((short(250_000.0), short(2_500_000.0)), ("250 k".into(), "2.50 M".into()));
        assert_eq!(parse_short("250 k"), Some(250_000.0));
        assert_eq!(parse_short("1.5M"), Some(1_500_000.0));
        assert_eq!(parse_short("12,000"), Some(12_000.0));
        assert_eq!(parse_short("many"), None);
    }
}
