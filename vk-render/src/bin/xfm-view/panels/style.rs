//! How panels look.

use egui::{Color32, CornerRadius, FontFamily, FontId, Margin, Shadow, Stroke, TextStyle, Visuals};

pub(crate) const TEXT: Color32 = Color32::from_rgb(228, 231, 236);
pub(crate) const FAINT: Color32 = Color32::from_rgb(160, 168, 180);
pub(crate) const PANEL: Color32 = Color32::from_rgb(30, 33, 39);
pub(crate) const ACCENT: Color32 = Color32::from_rgb(86, 156, 214);
pub(crate) const WARN: Color32 = Color32::from_rgb(240, 176, 72);
pub(crate) const BAD: Color32 = Color32::from_rgb(240, 104, 96);

/// Dark, opaque enough to be read over any model, with room to hit things.
pub(crate) fn apply(context: &egui::Context) {
    context.set_theme(egui::Theme::Dark);
    context.all_styles_mut(|style| {
        let mut visuals = Visuals::dark();
        visuals.panel_fill = PANEL;
        visuals.window_fill = PANEL;
        visuals.window_stroke = Stroke::new(1.0, Color32::from_rgb(58, 63, 72));
        visuals.window_shadow = Shadow::NONE;
        visuals.popup_shadow = Shadow::NONE;
        visuals.window_corner_radius = CornerRadius::same(6);
        visuals.menu_corner_radius = CornerRadius::same(6);
        visuals.override_text_color = Some(TEXT);
        visuals.selection.bg_fill = Color32::from_rgb(38, 92, 140);
        visuals.slider_trailing_fill = true;
        let widgets = &mut visuals.widgets;
        widgets.inactive.weak_bg_fill = Color32::from_rgb(52, 57, 66);
        widgets.inactive.bg_fill = Color32::from_rgb(66, 72, 83);
        widgets.hovered.weak_bg_fill = Color32::from_rgb(70, 77, 90);
        widgets.active.weak_bg_fill = Color32::from_rgb(38, 92, 140);
        style.visuals = visuals;
        let font = |size, family| FontId::new(size, family);
        style.text_styles = [
            (TextStyle::Heading, font(16.0, FontFamily::Proportional)),
            (TextStyle::Body, font(13.5, FontFamily::Proportional)),
            (TextStyle::Button, font(13.5, FontFamily::Proportional)),
            (TextStyle::Monospace, font(12.5, FontFamily::Monospace)),
            (TextStyle::Small, font(11.5, FontFamily::Proportional)),
        ]
        .into();
        style.spacing.item_spacing = egui::vec2(8.0, 5.0);
        style.spacing.button_padding = egui::vec2(8.0, 3.0);
        style.spacing.window_margin = Margin::same(10);
        style.spacing.slider_width = 150.0;
        style.interaction.selectable_labels = false;
        style.animation_time = 0.0;
    });
}
