//! The strip of photographs.

use crate::app::state::{App, Shown};
use crate::app::theme;
use crate::capture::photograph::Photograph;
use crate::math::color::to_srgb8;
use crate::session::snapshot::OpenCapture;
use egui::{ColorImage, ScrollArea, Sense, TextureHandle, TextureOptions, Ui, vec2};
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
        let exposure = self.exposure;
        self.textures
            .entry(frame)
            .or_insert_with(|| {
                let image = small(photograph, exposure);
                ui.ctx()
                    .load_texture(format!("photograph {frame}"), image, TextureOptions::LINEAR)
            })
            .clone()
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
pub fn strip(ui: &mut Ui, app: &mut App) {
    let Some(capture) = app.capture().cloned() else {
        return;
    };
    let new = !matches!(&app.thumbnails.capture, Some(known) if Arc::ptr_eq(known, &capture));
    if new {
        app.thumbnails = Thumbnails {
            capture: Some(capture.clone()),
            exposure: app.look.exposure.exp2(),
            ..Thumbnails::default()
        };
    }
    let tokens = theme::tokens(ui);
    let mut chosen = None;
    ScrollArea::horizontal().auto_shrink(false).show(ui, |ui| {
        ui.horizontal(|ui| {
            for (frame, photograph) in capture.photographs.iter().enumerate() {
                let aspect = photograph.width as f32 / photograph.height.max(1) as f32;
                let size = vec2(theme::THUMBNAIL * aspect, theme::THUMBNAIL);
                let (rect, response) = ui.allocate_exact_size(size, Sense::click());
                response.widget_info(|| {
                    egui::WidgetInfo::labeled(
                        egui::Role::Button,
                        true,
                        format!("Photograph {}", frame + 1),
                    )
                });
                let current = frame == app.frame && matches!(app.shown, Shown::Frame);
                if current && app.thumbnails.followed != frame {
                    response.scroll_to_me(None);
                    app.thumbnails.followed = frame;
                }
                if ui.is_rect_visible(rect) {
                    let texture = app.thumbnails.texture(ui, frame, photograph);
                    egui::Image::new(&texture).paint_at(ui, rect);
                    let color = if current {
                        tokens.accent
                    } else if response.hovered() {
                        tokens.strong
                    } else {
                        egui::Color32::TRANSPARENT
                    };
                    ui.painter()
                        .rect_stroke(rect, 0.0, (2.0, color), egui::StrokeKind::Inside);
                }
                if response
                    .on_hover_text(format!("Photograph {}, in files {frame:03}", frame + 1))
                    .clicked()
                {
                    chosen = Some(frame);
                }
            }
        });
    });
    if let Some(frame) = chosen {
        app.thumbnails.followed = frame;
        app.show_frame(frame);
    }
}
