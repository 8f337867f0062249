//! The strip of photographs.

use crate::app::controls::named;
use crate::app::document::Document;
use crate::app::request::{Request, Requests};
use crate::app::shown::Shown;
use crate::app::theme;
use crate::capture::photograph::Photograph;
use crate::math::color::to_srgb8;
use crate::session::snapshot::OpenCapture;
use egui::{
    Color32, ColorImage, Image, Role, ScrollArea, Sense, StrokeKind, TextureHandle, TextureOptions,
    Ui, vec2,
};
use std::collections::HashMap;
use std::sync::Arc;

/// Small textures of photographs, made as they come into view.
#[derive(Default)]
pub struct Thumbnails {
    capture: Option<Arc<OpenCapture>>,
    exposure: f32,
    textures: HashMap<usize, TextureHandle>,
    followed: usize,
}

impl Thumbnails {
    fn texture(&mut self, ui: &Ui, frame: usize, photograph: &Photograph) -> TextureHandle {
        let texture = self.textures.entry(frame).or_insert_with(|| {
            let name = format!("photograph {frame}");
            let image = small(photograph, self.exposure);
            ui.ctx().load_texture(name, image, TextureOptions::LINEAR)
        });
        texture.clone()
    }
}

/// A photograph reduced to a thumbnail's height by taking every n-th pixel.
fn small(photograph: &Photograph, exposure: f32) -> ColorImage {
    let stride = (photograph.height / (theme::THUMBNAIL as u32 * 2)).max(1) as usize;
    let (width, height) = (photograph.width as usize, photograph.height as usize);
    let columns = width.div_ceil(stride);
    let mut bytes = Vec::with_capacity(columns * height.div_ceil(stride) * 3);
    for row in photograph.pixels.chunks(width.max(1)).step_by(stride) {
        for pixel in row.iter().step_by(stride) {
            bytes.extend(to_srgb8(*pixel, exposure));
        }
    }
    let rows = bytes.len() / (3 * columns.max(1));
    ColorImage::from_rgb([columns, rows], &bytes)
}

/// Draws the strip.
pub fn strip(
    ui: &mut Ui,
    document: &Document,
    shown: &Shown,
    exposure: f32,
    thumbnails: &mut Thumbnails,
    requests: &mut Requests,
) {
    let Some(capture) = document.capture() else {
        return;
    };
    if !matches!(&thumbnails.capture, Some(known) if Arc::ptr_eq(known, capture)) {
        *thumbnails = Thumbnails {
            capture: Some(capture.clone()),
            exposure: exposure.exp2(),
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
                let current = shown.photograph() == Some(frame);
                if current && thumbnails.followed != frame {
                    response.scroll_to_me(None);
                    thumbnails.followed = frame;
                }
                if ui.is_rect_visible(rect) {
                    let texture = thumbnails.texture(ui, frame, photograph);
                    Image::new(&texture).paint_at(ui, rect);
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
                    requests.ask(Request::Show(frame));
                }
            }
        });
    });
}
