//! What a pixel holds, in words; and the legend of false colours.

use crate::app::picture::canvas::Drawn;
use crate::app::picture::quantity::{Quantity, Shading};
use crate::app::picture::ramp;
use crate::app::state::App;
use crate::app::theme;
use crate::math::color::linear_to_srgb;
use egui::{Align2, Color32, FontId, Mesh, Rect, RichText, Ui, pos2, vec2};
use glam::Vec3;

/// A number in few characters.
pub fn number(v: f32) -> String {
    let magnitude = v.abs();
    if v == 0.0 {
        "0".to_owned()
    } else if !v.is_finite() {
        v.to_string()
    } else if !(1e-3..1e4).contains(&magnitude) {
        format!("{v:.1e}")
    } else if magnitude < 1.0 {
        let decimals = (2.0 - magnitude.log10().floor()) as usize;
        format!("{v:.decimals$}")
    } else if magnitude < 100.0 {
        format!("{v:.2}")
    } else {
        format!("{v:.0}")
    }
}

/// Three numbers with a space between.
pub fn triple(v: Vec3) -> String {
    let [r, g, b] = v.to_array().map(number);
    format!("{r} {g} {b}")
}

/// One line about the pixel under the pointer, or what the next click is asked for.
pub fn bar(ui: &mut Ui, app: &App) {
    let tokens = theme::tokens(ui);
    if let Some(pick) = app.picking {
        ui.horizontal(|ui| {
            ui.colored_label(tokens.accent, pick.prompt());
            ui.weak("Esc ends this");
        });
        return;
    }
    let Some(cursor) = app.look.cursor else {
        ui.label(RichText::new("Point at a picture to read its values").color(tokens.weak));
        return;
    };
    let Some(drawn) = app.drawn(cursor.over) else {
        return;
    };
    let pixel = |drawn: &Drawn| {
        let (w, h) = (drawn.picture.width, drawn.picture.height);
        let x = ((cursor.at.x * w as f32) as u32).min(w.saturating_sub(1));
        let y = ((cursor.at.y * h as f32) as u32).min(h.saturating_sub(1));
        (x, y, (y * w + x) as usize)
    };
    let (x, y, index) = pixel(&drawn);
    let Some(&value) = drawn.picture.pixels.get(index) else {
        return;
    };
    let mut text = egui::text::LayoutJob::default();
    let mut part = |label: &str, value: &str| {
        let font = |color| egui::TextFormat::simple(FontId::monospace(11.5), color);
        text.append(
            label,
            if label.is_empty() { 0.0 } else { 12.0 },
            font(tokens.weak),
        );
        text.append(value, 4.0, font(tokens.strong));
    };
    part("", &format!("({x}, {y})"));
    part(
        cursor.over.name(),
        &match cursor.over.shading() == Shading::Positive && value.x < 0.0 {
            true => "not known".to_owned(),
            false => format!(
                "{} {}",
                triple(value),
                cursor.over.unit(app.radiance_unit())
            ),
        },
    );
    if cursor.over.shading() == Shading::Radiance {
        let shown = (value * app.look.exposure.exp2())
            .to_array()
            .map(linear_to_srgb);
        part(
            "sRGB",
            &shown
                .map(|v| ((v * 255.0 + 0.5) as u8).to_string())
                .join(" "),
        );
    } else if cursor.over == Quantity::Albedo {
        let shown = value.to_array().map(linear_to_srgb);
        part(
            "sRGB",
            &shown
                .map(|v| ((v * 255.0 + 0.5) as u8).to_string())
                .join(" "),
        );
    }
    let object = drawn
        .objects
        .as_ref()
        .and_then(|objects| objects.get(index))
        .map(|&object| object as usize);
    let named = object.and_then(|index| {
        let name = &app.capture()?.scene.objects.get(index)?.name;
        Some((name, app.estimate.objects.get(index)?))
    });
    if let Some((name, estimate)) = named {
        part("object", name);
        let error = (estimate.albedo_stderr.element_sum()) / 3.0;
        part(
            "albedo",
            &format!("{} ± {}", triple(estimate.albedo), number(error)),
        );
        if estimate.emission != Vec3::ZERO {
            part("emission", &triple(estimate.emission));
        }
    }
    ui.add(egui::Label::new(text).truncate());
}

/// Draws the legend of a false-colour picture into a corner of its pane.
pub fn legend(ui: &Ui, pane: Rect, drawn: &Drawn) {
    let shading = drawn.quantity.shading();
    let font = FontId::proportional(11.0);
    let width = (pane.width() - 24.0).clamp(60.0, 180.0);
    let box_size = vec2(width + 16.0, 32.0);
    let frame = Rect::from_min_size(
        pos2(pane.left() + 6.0, pane.bottom() - box_size.y - 6.0),
        box_size,
    );
    let painter = ui.painter().with_clip_rect(pane.intersect(ui.clip_rect()));
    painter.rect_filled(frame, 3.0, Color32::from_black_alpha(190));
    let strip = Rect::from_min_size(frame.min + vec2(8.0, 5.0), vec2(width, 8.0));
    let mut mesh = Mesh::default();
    for i in 0..ramp::STOPS {
        let t = i as f32 / (ramp::STOPS - 1) as f32;
        let [r, g, b] = ramp::color(shading, t).map(|v| (v * 255.0 + 0.5) as u8);
        let x = strip.left() + t * strip.width();
        mesh.colored_vertex(pos2(x, strip.top()), Color32::from_rgb(r, g, b));
        mesh.colored_vertex(pos2(x, strip.bottom()), Color32::from_rgb(r, g, b));
        if i > 0 {
            let k = 2 * i as u32;
            mesh.add_triangle(k - 2, k - 1, k);
            mesh.add_triangle(k - 1, k, k + 1);
        }
    }
    painter.add(mesh);
    let (low, middle) = match shading {
        Shading::Signed => (-drawn.range, 0.0),
        _ => (0.0, drawn.range * 0.5),
    };
    let y = strip.bottom() + 9.0;
    for (x, value, align) in [
        (strip.left(), low, Align2::LEFT_CENTER),
        (strip.center().x, middle, Align2::CENTER_CENTER),
        (strip.right(), drawn.range, Align2::RIGHT_CENTER),
    ] {
        painter.text(
            pos2(x, y),
            align,
            number(value),
            font.clone(),
            Color32::WHITE,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_keep_their_size() {
        for (value, text) in [
            (0.0, "0"),
            (0.12345, "0.123"),
            (0.02344, "0.0234"),
            (-3.456, "-3.46"),
            (1234.5, "1234"),
            (1e-5, "1.0e-5"),
            (2.5e7, "2.5e7"),
        ] {
            assert_eq!(number(value), text);
        }
        assert_eq!(number(f32::NAN), "NaN");
    }
}
