//! A pane with one picture: zoom and pan shared by all, clicks that select or place.

use crate::app::controls::named;
use crate::app::picture::drawn::Drawn;
use crate::app::picture::gpu::PicturePaint;
use crate::app::picture::inspect;
use crate::app::picture::look::{Cursor, fraction};
use crate::app::picture::quantity::{Quantity, Shading};
use crate::app::request::Request;
use crate::app::shown::ray;
use crate::app::theme;
use crate::app::view::Parts;
use crate::scene::camera::Camera;
use egui::{Color32, Id, Pos2, Rect, Response, Role, Sense, Ui, UiBuilder, vec2};

pub fn pane(ui: &mut Ui, parts: &mut Parts<'_>, rect: Rect, quantity: Quantity) {
    let shown = parts.view.look.held(quantity);
    parts.view.needed.note(shown);
    let Some(drawn) = parts.view.drawn(parts.document, shown) else {
        missing(ui, parts, rect, shown);
        return;
    };
    let name = format!("{} picture", quantity.name());
    interact(ui, parts, rect, &drawn, &name);
    paint(ui, parts, rect, &drawn, Id::unique(("picture", quantity)));
}

/// Says why there is no picture.
pub fn missing(ui: &mut Ui, parts: &Parts<'_>, rect: Rect, quantity: Quantity) {
    let free = parts.view.shown.free.is_some();
    let text = match quantity {
        _ if parts.document.capture().is_none() => parts.document.nothing_open(),
        Quantity::Photograph => "No photograph was taken from here",
        Quantity::Error | Quantity::Composite if free => "No photograph was taken from here",
        Quantity::Naive | Quantity::NaiveEstimate => "Compositing…",
        _ => "Waiting for the first picture…",
    };
    let mut ui = ui.new_child(UiBuilder::new().max_rect(rect));
    let surround = theme::tokens(&ui).surround;
    ui.painter().rect_filled(rect, 0.0, surround);
    ui.centered_and_justified(|ui| ui.weak(text));
}

/// Zoom, pan, cursor, selection and placing.
pub fn interact(ui: &mut Ui, parts: &mut Parts<'_>, rect: Rect, drawn: &Drawn, name: &str) {
    let size = drawn.size();
    let response = ui.allocate_rect(rect, Sense::click_and_drag());
    let response = named(response, Role::Image, name);
    let view = &mut *parts.view;
    let side = view.look.placement(rect, size).size().max_elem() * ui.pixels_per_point();
    view.needed.pixels = view.needed.pixels.max(side);

    if let Some(pointer) = response.hover_pos() {
        let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta.y, input.zoom_delta()));
        let factor = (scroll * 0.005).exp() * pinch;
        if factor != 1.0 {
            view.look.zoom_at(rect, size, pointer, factor);
        }
        let at = fraction(view.look.placement(rect, size), pointer);
        if Rect::from_min_size(Pos2::ZERO, vec2(1.0, 1.0)).contains(at) {
            let over = drawn.quantity;
            view.look.cursor = Some(Cursor { at, over });
        }
    }
    drag(parts, rect, size, &response);
    let view = &mut *parts.view;
    let kept = view.tool.transform.take_if(|_| response.clicked());
    if kept.is_some() {
        // The click kept what the keys began.
    } else if response.double_clicked() {
        view.look.fit();
    } else if response.clicked()
        && let Some(pointer) = response.interact_pointer_pos()
    {
        let at = fraction(view.look.placement(rect, size), pointer);
        let more = ui.input(|input| input.modifiers.command);
        let clicked = view.shown.surface_at(parts.document, at);
        parts.requests.ask(Request::Click(clicked, more));
    }
    if view.tool.is_active() {
        response.on_hover_cursor(egui::CursorIcon::Crosshair);
    }
}

/// Moves an inserted object, or pans.
fn drag(parts: &mut Parts<'_>, rect: Rect, size: [u32; 2], response: &Response) {
    let (document, view) = (parts.document, &mut *parts.view);
    let placement = view.look.placement(rect, size);
    let Some((capture, camera)) = document.capture().zip(view.shown.camera(document)) else {
        return;
    };
    let project = |point| on_screen(camera, placement, point);
    let aim = |pointer| {
        let at = fraction(placement, pointer);
        let surface = view.shown.surface_at(document, at);
        (ray(camera, at), surface.map(|at| at.point))
    };
    let (scene, insertions) = (&capture.scene, &document.insertions);
    let started = response.drag_started();
    let (holds, placed) = (view.tool).follow(response, started, insertions, scene, project, aim);
    if !holds && response.dragged() {
        view.look.pan(rect, size, response.drag_delta());
    }
    (parts.requests).ask_all(placed.map(|(index, to)| Request::Place(index, to)));
}

/// Where a scene point is on the screen, when the camera's picture lies at `placement`.
fn on_screen(camera: &Camera, placement: Rect, point: glam::Vec3) -> Option<Pos2> {
    let k = &camera.intrinsics;
    let pixel = camera.project(point)?;
    let fraction = vec2(pixel.x / k.width as f32, pixel.y / k.height as f32);
    Some(placement.min + fraction * placement.size())
}

/// Draws the picture, and over it the cursor, the legend and the handles of inserted objects.
pub fn paint(ui: &Ui, parts: &Parts<'_>, rect: Rect, drawn: &Drawn, slot: Id) {
    let (view, tokens) = (&parts.view, theme::tokens(ui));
    let paint = PicturePaint {
        slot,
        drawn: drawn.clone(),
        look: view.look.clone(),
        pane: rect,
        selected: view.selection.object,
        tokens,
    };
    let paint = eframe::egui_wgpu::Callback::new_paint_callback(rect, paint);
    ui.painter().add(paint);
    let placement = view.look.placement(rect, drawn.size());
    let painter = ui.painter().with_clip_rect(rect.intersect(ui.clip_rect()));

    let boxed = view.tool.placing || view.tool.dragged.is_some();
    // Nothing covers a result that is only looked at.
    let handles = boxed || ui.rect_contains_pointer(rect);
    let document = parts.document;
    let seen = document.capture().zip(view.shown.camera(document));
    if let Some((capture, camera)) = seen.filter(|_| handles) {
        let project = |point| on_screen(camera, placement, point);
        let (scene, insertions) = (&capture.scene, &document.insertions);
        insertions.draw_handles(&painter, scene, tokens, boxed, project);
    }
    // The cursor of the pane that the pointer is in, in all the others.
    if let Some(cursor) = view.look.cursor
        && cursor.over != drawn.quantity
    {
        let at = placement.min + cursor.at.to_vec2() * placement.size();
        for (color, width) in [(Color32::from_black_alpha(160), 3.0), (tokens.strong, 1.0)] {
            for arm in [
                vec2(1.0, 0.0),
                vec2(0.0, 1.0),
                vec2(-1.0, 0.0),
                vec2(0.0, -1.0),
            ] {
                painter.line_segment([at + arm * 3.0, at + arm * 9.0], (width, color));
            }
        }
    }
    let shading = drawn.quantity.shading();
    if matches!(shading, Shading::Signed | Shading::Positive) {
        inspect::legend(ui, rect, drawn);
    }
}
