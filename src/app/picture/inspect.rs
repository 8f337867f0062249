//! What a pixel holds, in words; and the legend of false colours.

use crate::app::document::Document;
use crate::app::number::{number, triple};
use crate::app::picture::drawn::Drawn;
use crate::app::picture::quantity::Shading;
use crate::app::picture::ramp;
use crate::app::theme;
use crate::app::view::ViewState;
use crate::math::color::linear_to_srgb;
use egui::{Align2, Color32, FontId, Mesh, Rect, RichText, Ui, pos2, vec2};
use glam::Vec3;

/// One line about the pixel under the pointer, or what the next click is asked for.
pub fn bar(ui: &mut Ui, document: &Document, view: &ViewState) {
    let tokens = theme::tokens(ui);
    if let Some(pick) = view.tool.pick {
        ui.horizontal(|ui| {
            ui.colored_label(tokens.accent, pick.prompt());
            ui.weak("Esc ends this");
        });
        return;
    }
    if let Some(transform) = &view.tool.transform {
        ui.colored_label(tokens.accent, transform.words());
        return;
    }
    let Some(cursor) = view.look.cursor else {
        ui.label(RichText::new("Point at a picture to read its values").color(tokens.weak));
        return;
    };
    let quantity = cursor.over;
    let Some(drawn) = view.drawn(document, quantity) else {
        return;
    };
    let along = |at: f32, size: u32| ((at * size as f32) as u32).min(size.saturating_sub(1));
    let x = along(cursor.at.x, drawn.picture.width);
    let y = along(cursor.at.y, drawn.picture.height);
    let index = (y * drawn.picture.width + x) as usize;
    let Some(&value) = drawn.picture.pixels.get(index) else {
        return;
    };
    let mut text = egui::text::LayoutJob::default();
    let mut part = |label: &str, value: &str| {
        let font = |color| egui::TextFormat::simple(FontId::monospace(11.5), color);
        let space = if label.is_empty() { 0.0 } else { 12.0 };
        text.append(label, space, font(tokens.weak));
        text.append(value, 4.0, font(tokens.strong));
    };
    part("", &format!("({x}, {y})"));
    let unit = quantity.unit(document.radiance_unit());
    match quantity.shading() == Shading::Positive && value.x < 0.0 {
        true => part(quantity.name(), "not known"),
        false => part(quantity.name(), &format!("{} {unit}", triple(value))),
    }
    let shown = match quantity.shading() {
        Shading::Radiance => Some(value * view.look.exposure.exp2()),
        Shading::Reflectance => Some(value),
        _ => None,
    };
    if let Some(shown) = shown {
        let srgb = shown.to_array().map(linear_to_srgb);
        let bytes = srgb.map(|v| ((v * 255.0 + 0.5) as u8).to_string());
        part("sRGB", &bytes.join(" "));
    }
    let objects = drawn.objects.as_ref();
    let object = objects.and_then(|objects| objects.get(index));
    let named = object.and_then(|&object| {
        let object = object as usize;
        let name = &document.capture()?.scene.objects.get(object)?.name;
        Some((name, document.estimate.objects.get(object)?))
    });
    if let Some((name, estimate)) = named {
        part("object", name);
        let error = number(estimate.albedo_stderr.element_sum() / 3.0);
        part("albedo", &format!("{} ± {error}", triple(estimate.albedo)));
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
    let corner = pane.left_bottom() + vec2(6.0, -6.0 - box_size.y);
    let frame = Rect::from_min_size(corner, box_size);
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
        let (at, text) = (pos2(x, y), number(value));
        painter.text(at, align, text, font.clone(), Color32::WHITE);
    }
}
