//! Design tokens: every colour, size and rounding of the window, for the dark and the light theme.

use egui::style::{Selection, WidgetVisuals};
use egui::{Color32, CornerRadius, FontFamily, FontId, Stroke, TextStyle, Theme, Ui, Visuals};

/// The named colours of one theme.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tokens {
    /// Behind tiles and in text fields.
    pub sunken: Color32,
    /// Panels and tiles.
    pub panel: Color32,
    /// Buttons and menus.
    pub raised: Color32,
    /// Buttons under the pointer.
    pub hovered: Color32,
    /// Lines between things.
    pub outline: Color32,
    /// Text.
    pub text: Color32,
    /// Text of less weight; still at least 4.5 : 1 against `panel`.
    pub weak: Color32,
    /// Titles, and text on what is pressed.
    pub strong: Color32,
    /// What is selected, active or can be followed.
    pub accent: Color32,
    /// Behind selected rows and text.
    pub selection: Color32,
    /// Done, kept.
    pub good: Color32,
    /// Worked around.
    pub warning: Color32,
    /// Failed.
    pub error: Color32,
    /// The loss over pixels in the fit.
    pub train: Color32,
    /// The loss over held-out pixels.
    pub held_out: Color32,
    /// Around pictures, where no pixel is.
    pub surround: Color32,
    /// Camera outlines in the 3D view.
    pub camera: Color32,
    /// Inserted objects in the views.
    pub inserted: Color32,
}

/// The dark theme.
pub const DARK: Tokens = Tokens {
    sunken: Color32::from_rgb(22, 23, 26),
    panel: Color32::from_rgb(32, 34, 38),
    raised: Color32::from_rgb(52, 55, 61),
    hovered: Color32::from_rgb(68, 72, 80),
    outline: Color32::from_rgb(60, 63, 70),
    text: Color32::from_rgb(214, 217, 222),
    weak: Color32::from_rgb(154, 159, 168),
    strong: Color32::from_rgb(245, 246, 248),
    accent: Color32::from_rgb(255, 170, 61),
    selection: Color32::from_rgb(108, 72, 24),
    good: Color32::from_rgb(116, 196, 118),
    warning: Color32::from_rgb(240, 196, 83),
    error: Color32::from_rgb(242, 109, 97),
    train: Color32::from_rgb(110, 173, 236),
    held_out: Color32::from_rgb(255, 170, 61),
    surround: Color32::from_rgb(14, 15, 17),
    camera: Color32::from_rgb(110, 173, 236),
    inserted: Color32::from_rgb(116, 216, 168),
};

/// The light theme.
pub const LIGHT: Tokens = Tokens {
    sunken: Color32::from_rgb(255, 255, 255),
    panel: Color32::from_rgb(243, 243, 244),
    raised: Color32::from_rgb(224, 225, 228),
    hovered: Color32::from_rgb(208, 210, 215),
    outline: Color32::from_rgb(196, 198, 204),
    text: Color32::from_rgb(38, 40, 45),
    weak: Color32::from_rgb(92, 96, 105),
    strong: Color32::from_rgb(10, 11, 13),
    accent: Color32::from_rgb(166, 86, 0),
    selection: Color32::from_rgb(255, 219, 168),
    good: Color32::from_rgb(26, 122, 44),
    warning: Color32::from_rgb(138, 92, 0),
    error: Color32::from_rgb(188, 38, 28),
    train: Color32::from_rgb(21, 98, 176),
    held_out: Color32::from_rgb(172, 85, 0),
    surround: Color32::from_rgb(214, 215, 218),
    camera: Color32::from_rgb(21, 98, 176),
    inserted: Color32::from_rgb(0, 120, 78),
};

/// Height of a row in tables, in points.
pub const ROW: f32 = 20.0;
/// Gap between neighbouring widgets, in points.
pub const GAP: f32 = 6.0;
/// Side of a colour swatch, in points.
pub const SWATCH: f32 = 14.0;
/// Height of the thumbnails, in points.
pub const THUMBNAIL: f32 = 52.0;

const ROUNDING: CornerRadius = CornerRadius::same(3);

/// The tokens of the theme that `ui` is drawn in.
pub fn tokens(ui: &Ui) -> &'static Tokens {
    of(ui.visuals())
}

/// The tokens that `visuals` were made from.
pub fn of(visuals: &Visuals) -> &'static Tokens {
    if visuals.dark_mode { &DARK } else { &LIGHT }
}

/// The strip of controls above a picture.
pub fn strip(ui: &Ui) -> egui::Frame {
    egui::Frame::NONE
        .fill(tokens(ui).panel)
        .inner_margin(egui::Margin::symmetric(6, 3))
}

/// Installs both themes in a context.
pub fn install(ctx: &egui::Context) {
    for (theme, tokens) in [(Theme::Dark, &DARK), (Theme::Light, &LIGHT)] {
        ctx.style_mut_of(theme, |style| {
            style.visuals = visuals(theme, tokens);
            style.text_styles = [
                (
                    TextStyle::Small,
                    FontId::new(10.5, FontFamily::Proportional),
                ),
                (TextStyle::Body, FontId::new(13.0, FontFamily::Proportional)),
                (
                    TextStyle::Button,
                    FontId::new(13.0, FontFamily::Proportional),
                ),
                (
                    TextStyle::Heading,
                    FontId::new(19.0, FontFamily::Proportional),
                ),
                (
                    TextStyle::Monospace,
                    FontId::new(12.0, FontFamily::Monospace),
                ),
            ]
            .into();
            style.spacing.item_spacing = egui::vec2(GAP, 4.0);
            style.spacing.button_padding = egui::vec2(8.0, 3.0);
            style.spacing.interact_size.y = ROW;
            style.spacing.slider_width = 96.0;
        });
    }
}

/// egui's colours from the tokens.
fn visuals(theme: Theme, tokens: &Tokens) -> Visuals {
    let widget = |fill: Color32, line: Color32, text: Color32| WidgetVisuals {
        bg_fill: fill,
        weak_bg_fill: fill,
        bg_stroke: Stroke::new(1.0, line),
        fg_stroke: Stroke::new(1.0, text),
        corner_radius: ROUNDING,
        expansion: 0.0,
    };
    let mut visuals = theme.default_visuals();
    visuals.widgets.noninteractive = widget(tokens.panel, tokens.outline, tokens.text);
    visuals.widgets.inactive = widget(tokens.raised, Color32::TRANSPARENT, tokens.text);
    visuals.widgets.hovered = widget(tokens.hovered, tokens.outline, tokens.strong);
    visuals.widgets.active = widget(tokens.hovered, tokens.accent, tokens.strong);
    visuals.widgets.open = widget(tokens.raised, tokens.outline, tokens.strong);
    visuals.selection = Selection {
        bg_fill: tokens.selection,
        stroke: Stroke::new(1.0, tokens.strong),
    };
    visuals.weak_text_color = Some(tokens.weak);
    visuals.hyperlink_color = tokens.accent;
    visuals.faint_bg_color = tokens.panel.lerp_to_gamma(tokens.raised, 0.3);
    visuals.extreme_bg_color = tokens.sunken;
    visuals.code_bg_color = tokens.sunken;
    visuals.warn_fg_color = tokens.warning;
    visuals.error_fg_color = tokens.error;
    visuals.window_fill = tokens.panel;
    visuals.window_stroke = Stroke::new(1.0, tokens.outline);
    visuals.window_corner_radius = CornerRadius::same(6);
    visuals.menu_corner_radius = CornerRadius::same(4);
    visuals.panel_fill = tokens.panel;
    visuals.slider_trailing_fill = true;
    visuals
}

/// The opaque screen colour of a linear colour, clamped to [0, 1].
pub fn swatch(linear: glam::Vec3) -> Color32 {
    let [r, g, b] = crate::math::color::to_srgb8(linear, 1.0);
    Color32::from_rgb(r, g, b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::color::srgb_to_linear;

    fn contrast(a: Color32, b: Color32) -> f32 {
        let luminance = |c: Color32| {
            let [r, g, b] = [c.r(), c.g(), c.b()].map(|v| srgb_to_linear(f32::from(v) / 255.0));
            0.2126 * r + 0.7152 * g + 0.0722 * b + 0.05
        };
        let (a, b) = (luminance(a), luminance(b));
        a.max(b) / a.min(b)
    }

    #[test]
    fn text_can_be_read_in_both_themes() {
        for tokens in [DARK, LIGHT] {
            for ground in [tokens.panel, tokens.sunken] {
                for text in [
                    tokens.text,
                    tokens.weak,
                    tokens.strong,
                    tokens.accent,
                    tokens.good,
                    tokens.warning,
                    tokens.error,
                    tokens.train,
                    tokens.held_out,
                ] {
                    let ratio = contrast(text, ground);
                    assert!(ratio >= 4.5, "{text:?} on {ground:?}: {ratio}");
                }
            }
            assert!(contrast(tokens.strong, tokens.selection) >= 4.5);
            assert!(contrast(tokens.text, tokens.raised) >= 4.5);
        }
    }
}
