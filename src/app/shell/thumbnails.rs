//! The strip of photographs.

use crate::app::controls::named;
use crate::app::request::Request;
use crate::app::shell::Thumbnails;
use crate::app::theme;
use crate::app::view::Parts;
use crate::capture::photograph::Photograph;
use crate::math::color::to_srgb8;
use egui::{
    Color32, ColorImage, Image, Role, ScrollArea, Sense, StrokeKind, TextureOptions, Ui, vec2,
};
use std::sync::Arc;

/// A photograph reduced to a thumbnail's height by taking every n-th pixel.
fn small(photograph: &Photograph, exposure: f32) -> ColorImage {
    let stride = (photograph.height / (theme::THUMBNAIL as u32 * 2)).max(1) as usize;
    let rows = photograph.pixels.chunks(photograph.width.max(1) as usize);
    let rows = rows.step_by(stride);
    let size = [(photograph.width as usize).div_ceil(stride), rows.len()];
    let pixels = rows.flat_map(|row| row.iter().step_by(stride));
    let bytes: Vec<u8> = pixels.flat_map(|&p| to_srgb8(p, exposure)).collect();
    ColorImage::from_rgb(size, &bytes)
}

pub fn strip(ui: &mut Ui, parts: &mut Parts<'_>) {
    let Some(capture) = parts.document.capture() else {
        return;
    };
    let thumbnails = &mut parts.view.shell.thumbnails;
    if !matches!(&thumbnails.capture, Some(known) if Arc::ptr_eq(known, capture)) {
        *thumbnails = Thumbnails {
            capture: Some(capture.clone()),
            exposure: parts.view.look.exposure.exp2(),
            ..Thumbnails::default()
        };
    }
    let tokens = theme::tokens(ui);
    ScrollArea::horizontal().auto_shrink(false).show(ui, |ui| {
        ui.horizontal(|ui| {
            for (frame, photograph) in capture.photographs.iter().enumerate() {
                let aspect = photograph.width as f32 / photograph.height.max(1) as f32;
                let size = vec2(theme::THUMBNAIL * aspect, theme::THUMBNAIL);
                let (rect, response) = ui.allocate_exact_size(size, Sense::click());
                let name = format!("Photograph {}", frame + 1);
                let response = named(response, Role::Button, &name);
                let current = parts.view.shown.photograph() == Some(frame);
                if current && thumbnails.followed != frame {
                    response.scroll_to_me(None);
                    thumbnails.followed = frame;
                }
                if ui.is_rect_visible(rect) {
                    let exposure = thumbnails.exposure;
                    let texture = thumbnails.textures.entry(frame).or_insert_with(|| {
                        let (name, image) = (name.clone(), small(photograph, exposure));
                        ui.ctx().load_texture(name, image, TextureOptions::LINEAR)
                    });
                    Image::new(&*texture).paint_at(ui, rect);
                    let color = match (current, response.hovered()) {
                        (true, _) => tokens.accent,
                        (false, true) => tokens.strong,
                        (false, false) => Color32::TRANSPARENT,
                    };
                    let (stroke, inside) = ((2.0, color), StrokeKind::Inside);
                    ui.painter().rect_stroke(rect, 0.0, stroke, inside);
                }
                let help = format!("{name}, in files {frame:03}");
                if response.on_hover_text(help).clicked() {
                    thumbnails.followed = frame;
                    parts.requests.ask(Request::Show(frame));
                }
            }
        });
    });
}
