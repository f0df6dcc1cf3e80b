//! What is written into the picture: picked points, legends, what is going on, messages.

use egui::{Align2, Area, Color32, Context, FontId, Frame, Id, Pos2, RichText, Stroke, pos2, vec2};
use glam::{DVec3, Vec3};
use mergetree::Camera;

use crate::action::Action;
use crate::model::paint_colours;
use crate::panels::{Facts, style};
use crate::state::{Look, State, length_text, position_text};

/// Where a point is seen, in pixels from the upper left; `None` behind the eye.
fn project(camera: &Camera, point: Vec3) -> Option<glam::Vec2> {
    let seen = camera.view_matrix().transform_point3(point);
    if seen.z >= 0.0 {
        return None;
    }
    let half = (0.5 * camera.fov_y).tan() * -seen.z;
    let share = glam::Vec2::new(seen.x / (half * camera.aspect()), -seen.y / half);
    let size = glam::Vec2::new(camera.width as f32, camera.height as f32);
    Some((share * 0.5 + 0.5) * size)
}

/// Picked points, and the line between them.
pub(super) fn points(context: &Context, state: &State, origin: DVec3) {
    let camera = state.camera();
    let scale = context.pixels_per_point();
    let seen: Vec<Option<Pos2>> = state
        .measure
        .points
        .iter()
        .map(|&point| project(&camera, point).map(|p| pos2(p.x / scale, p.y / scale)))
        .collect();
    let painter = context.layer_painter(egui::LayerId::background());
    if let [Some(a), Some(b)] = seen[..] {
        painter.line_segment([a, b], Stroke::new(4.0, Color32::from_black_alpha(160)));
        painter.line_segment([a, b], Stroke::new(2.0, style::WARN));
        if let Some(distance) = state.measure.distance() {
            let text = length_text(distance, state.radius());
            tag(&painter, a + 0.5 * (b - a) + vec2(0.0, 20.0), &text);
        }
    }
    for (name, (place, point)) in ["A", "B"].into_iter().zip(seen.iter().zip(&state.measure.points))
    {
        let Some(place) = *place else { continue };
        painter.circle_filled(place, 5.0, Color32::from_black_alpha(200));
        painter.circle_filled(place, 3.5, style::WARN);
        let text = match state.measure.points.len() {
            1 => position_text(*point, origin, state.radius()),
            _ => name.to_owned(),
        };
        tag(&painter, place + vec2(0.0, -18.0), &text);
    }
}

/// Text on a dark ground, centred.
fn tag(painter: &egui::Painter, centre: Pos2, text: &str) {
    let font = FontId::monospace(12.5);
    let text = painter.layout_no_wrap(text.to_owned(), font, style::TEXT);
    let rect = egui::Rect::from_center_size(centre, text.size() + vec2(10.0, 4.0));
    painter.rect_filled(rect, 3.0, style::PANEL);
    painter.galley(rect.min + vec2(5.0, 2.0), text, style::TEXT);
}

/// What the colours mean.
pub(super) fn legend(context: &Context, state: &State) {
    let rgb = |[r, g, b, _]: [u8; 4]| Color32::from_rgb(r, g, b);
    let entries: Vec<(Color32, &str)> = match state.look {
        Look::Lod => vec![
            (Color32::from_rgb(70, 75, 156), "coarse"),
            (Color32::from_rgb(53, 139, 214), ""),
            (Color32::from_rgb(38, 183, 172), ""),
            (Color32::from_rgb(144, 208, 84), ""),
            (Color32::from_rgb(243, 204, 59), ""),
            (Color32::from_rgb(228, 93, 63), "fine"),
        ],
        Look::Residency => paint_colours().map(|(colour, words)| (rgb(colour), words)).to_vec(),
        _ => return,
    };
    // Above the line at the bottom.
    area("legend", Align2::LEFT_BOTTOM, [8.0, -44.0]).show(context, |ui| {
        panel().show(ui, |ui| {
            ui.horizontal(|ui| {
                for (colour, words) in entries {
                    let (rect, _) = ui.allocate_exact_size(vec2(14.0, 14.0), egui::Sense::hover());
                    ui.painter().rect_filled(rect, 3.0, colour);
                    if !words.is_empty() {
                        ui.label(words);
                    }
                }
            });
        });
    });
}

/// Where messages begin, upwards from the lower edge: above the line with what the mouse does.
pub(super) const BOTTOM: f32 = -44.0;
/// In a window of fewer points there is no room between the panels.
const NARROW: f32 = 960.0;

/// What is going on that is not seen otherwise; where messages begin that are not to hide it.
pub(super) fn status(context: &Context, state: &State) -> f32 {
    let mut lines: Vec<(String, Color32)> = Vec::new();
    if let Some(recording) = &state.recording {
        let text = format!("Recording {:.1} s – R ends it", recording.seconds());
        lines.push((text, style::BAD));
    }
    if state.replay.is_some() {
        lines.push(("Replaying the path – Y ends it".into(), style::ACCENT));
    }
    if state.frozen.is_some() {
        let text = "Detail is frozen – L lets it follow, O shows it from outside";
        lines.push((text.into(), style::WARN));
    }
    if state.fly {
        lines.push(("Fly: drag looks about, W A S D, Q E walk – G ends it".into(), style::ACCENT));
    }
    if state.measure.on {
        let text = match state.measure.points.len() {
            0 => "Measure: click a point on the surface – T ends it",
            1 => "Measure: click a second point for the distance – T ends it",
            _ => "Measure: click for a new point – T ends it",
        };
        lines.push((text.into(), style::ACCENT));
    }
    if lines.is_empty() {
        return BOTTOM;
    }
    let narrow = context.content_rect().width() < NARROW;
    let (anchor, at) =
        if narrow { (Align2::CENTER_BOTTOM, BOTTOM) } else { (Align2::CENTER_TOP, 48.0) };
    let shown = area("status", anchor, [0.0, at]).interactable(false).show(context, |ui| {
        panel().show(ui, |ui| {
            for (text, colour) in lines {
                ui.add(egui::Label::new(RichText::new(text).color(colour)).extend());
            }
        });
    });
    if narrow { BOTTOM - shown.response.rect.height() - 4.0 } else { BOTTOM }
}

/// Messages, at the bottom of the picture, the latest lowest. Each is an area of its own, so that none is larger than its
/// text and in the way of the mouse.
pub(super) fn notices(context: &Context, state: &State, mut bottom: f32, asked: &mut Vec<Action>) {
    let width = (context.content_rect().width() - 80.0).min(760.0);
    for (i, notice) in state.notices.shown().iter().rev().enumerate() {
        let colour = if notice.is_error { style::BAD } else { style::TEXT };
        let text = RichText::new(&notice.text).color(colour);
        let anchored = area(&format!("notice {i}"), Align2::CENTER_BOTTOM, [0.0, bottom]);
        let shown = anchored.show(context, |ui| {
            ui.set_max_width(width);
            panel().show(ui, |ui| {
                let label = egui::Label::new(text).sense(egui::Sense::click());
                if ui.add(label).on_hover_text("Click to dismiss").clicked() {
                    asked.push(Action::DismissNotice(notice.text.clone()));
                }
            });
        });
        bottom -= shown.response.rect.height() + 4.0;
    }
}

/// What the mouse does, until it has been used.
pub(super) fn hint(context: &Context, state: &State, facts: &Facts<'_>) {
    if !state.panels.hint || facts.model.is_none() {
        return;
    }
    let text = "Drag: turn    Right drag: move    Wheel: zoom to the pointer    P: screenshot    ?: all keys";
    area("hint", Align2::CENTER_BOTTOM, [0.0, -10.0]).interactable(false).show(context, |ui| {
        panel().show(ui, |ui| ui.add(egui::Label::new(text).extend()));
    });
}

fn area(name: &str, anchor: Align2, offset: [f32; 2]) -> Area {
    Area::new(Id::new(name.to_owned())).anchor(anchor, offset).order(egui::Order::Middle)
}

fn panel() -> Frame {
    let edge = Stroke::new(1.0, Color32::from_rgb(58, 63, 72));
    Frame::new()
        .fill(style::PANEL)
        .stroke(edge)
        .corner_radius(5.0)
        .inner_margin(egui::Margin::symmetric(10, 5))
}
