//! Design tokens: every colour, size and rounding of the window, for the dark and the light theme.

use egui::style::{Selection, WidgetVisuals};
use egui::{Color32, CornerRadius, FontId, Stroke, TextStyle, Theme, Ui, Visuals};

/// One row: the colour's name, what it is for, and its red, green and blue in the dark and in the light theme.
macro_rules! tokens {
    ($($name:ident, $what:literal, $dark:tt, $light:tt;)*) => {
        /// The named colours of one theme.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct Tokens { $(#[doc = $what] pub $name: Color32,)* }

        pub const DARK: Tokens = Tokens { $($name: Color32::from_rgb $dark,)* };

        pub const LIGHT: Tokens = Tokens { $($name: Color32::from_rgb $light,)* };
    };
}

tokens! {
    sunken, "Behind tiles and in text fields.", (22, 23, 26), (255, 255, 255);
    panel, "Panels and tiles.", (32, 34, 38), (243, 243, 244);
    raised, "Buttons and menus.", (52, 55, 61), (224, 225, 228);
    hovered, "Buttons under the pointer.", (68, 72, 80), (208, 210, 215);
    outline, "Lines between things.", (60, 63, 70), (196, 198, 204);
    text, "Text.", (214, 217, 222), (38, 40, 45);
    weak, "Text of less weight; still at least 4.5 : 1 against `panel`.", (154, 159, 168), (92, 96, 105);
    strong, "Titles, and text on what is pressed.", (245, 246, 248), (10, 11, 13);
    accent, "What is selected, active or can be followed.", (255, 170, 61), (166, 86, 0);
    selection, "Behind selected rows and text.", (108, 72, 24), (255, 219, 168);
    good, "Done, kept.", (116, 196, 118), (26, 122, 44);
    warning, "Worked around.", (240, 196, 83), (138, 92, 0);
    error, "Failed.", (242, 109, 97), (188, 38, 28);
    train, "The loss over pixels in the fit.", (110, 173, 236), (21, 98, 176);
    held_out, "The loss over held-out pixels.", (255, 170, 61), (172, 85, 0);
    surround, "Around pictures, where no pixel is.", (14, 15, 17), (214, 215, 218);
    camera, "Camera outlines in the 3D view.", (110, 173, 236), (21, 98, 176);
    inserted, "Inserted objects in the views.", (116, 216, 168), (0, 120, 78);
}

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

/// Draws the strip of controls above a picture.
pub fn strip(ui: &mut Ui, controls: impl FnOnce(&mut Ui)) {
    let frame = egui::Frame::NONE.fill(tokens(ui).panel);
    let frame = frame.inner_margin(egui::Margin::symmetric(6, 3));
    frame.show(ui, |ui| {
        ui.set_min_width(ui.available_width());
        controls(ui);
    });
}

pub fn install(ctx: &egui::Context) {
    for (theme, tokens) in [(Theme::Dark, &DARK), (Theme::Light, &LIGHT)] {
        ctx.style_mut_of(theme, |style| {
            style.visuals = visuals(theme, tokens);
            style.text_styles = [
                (TextStyle::Small, FontId::proportional(10.5)),
                (TextStyle::Body, FontId::proportional(13.0)),
                (TextStyle::Button, FontId::proportional(13.0)),
                (TextStyle::Heading, FontId::proportional(19.0)),
                (TextStyle::Monospace, FontId::monospace(12.0)),
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
