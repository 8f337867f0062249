//! A pane with one picture: zoom and pan shared by all, clicks that select or place.

use crate::app::controls::named;
use crate::app::document::Document;
use crate::app::insertion::handles::Along;
use crate::app::picture::drawn::Drawn;
use crate::app::picture::gpu::PicturePaint;
use crate::app::picture::inspect;
use crate::app::picture::look::{Cursor, fraction};
use crate::app::picture::quantity::{Quantity, Shading};
use crate::app::request::{Request, Requests};
use crate::app::shown::ray;
use crate::app::theme;
use crate::app::view::ViewState;
use crate::scene::camera::Camera;
use egui::{Color32, Pos2, Rect, Response, Role, Sense, Ui, vec2};

/// Draws the pane of one picture.
pub fn pane(
    ui: &mut Ui,
    document: &Document,
    view: &mut ViewState,
    requests: &mut Requests,
    quantity: Quantity,
) {
    let rect = ui.max_rect();
    let shown = view.look.held(quantity);
    view.needed.note(shown);
    let Some(drawn) = view.drawn(document, shown) else {
        missing(ui, document, view, shown);
        return;
    };
    let name = format!("{} picture", quantity.name());
    interact(ui, document, view, requests, rect, &drawn, &name);
    let slot = egui::Id::unique(("picture", quantity));
    paint(ui, view, rect, &drawn, slot);
    overlay(ui, document, view, rect, &drawn);
}

/// Says why there is no picture.
pub fn missing(ui: &mut Ui, document: &Document, view: &ViewState, quantity: Quantity) {
    let free = view.shown.free.is_some();
    let text = match quantity {
        _ if document.capture().is_none() => document.nothing_open(),
        Quantity::Photograph => "No photograph was taken from here",
        Quantity::Error | Quantity::Composite if free => "No photograph was taken from here",
        Quantity::Naive | Quantity::NaiveEstimate => "Compositing…",
        _ => "Waiting for the first picture…",
    };
    let surround = theme::tokens(ui).surround;
    ui.painter().rect_filled(ui.max_rect(), 0.0, surround);
    ui.centered_and_justified(|ui| ui.weak(text));
}

/// Zoom, pan, cursor, selection and placing.
pub fn interact(
    ui: &mut Ui,
    document: &Document,
    view: &mut ViewState,
    requests: &mut Requests,
    rect: Rect,
    drawn: &Drawn,
    name: &str,
) {
    let size = [drawn.picture.width, drawn.picture.height];
    let response = ui.allocate_rect(rect, Sense::click_and_drag());
    let response = named(response, Role::Image, name);
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
    drag(ui, document, view, requests, rect, size, &response);
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
        requests.ask(Request::Click(view.shown.surface_at(document, at), more));
    }
    if view.tool.is_active() {
        response.on_hover_cursor(egui::CursorIcon::Crosshair);
    }
}

/// Drags a handle of an inserted object, or pans.
fn drag(
    ui: &Ui,
    document: &Document,
    view: &mut ViewState,
    requests: &mut Requests,
    rect: Rect,
    size: [u32; 2],
    response: &Response,
) {
    let placement = view.look.placement(rect, size);
    let Some((capture, camera)) = document.capture().zip(view.shown.camera(document)) else {
        return;
    };
    let (scene, insertions) = (&capture.scene, &document.insertions);
    if response.drag_started()
        && let Some(press) = ui.input(|input| input.pointer.press_origin())
    {
        let project = |point| on_screen(camera, placement, point);
        view.tool.dragged = insertions.handle_at(scene, press, project);
    }
    if response.drag_stopped() {
        view.tool.dragged = None;
    }
    let aim = |pointer| {
        let at = fraction(placement, pointer);
        let surface = view.shown.surface_at(document, at);
        (ray(camera, at), surface.map(|at| at.point))
    };
    if let Some(pointer) = response.hover_pos()
        && let Some(transform) = &mut view.tool.transform
    {
        let (ray, surface) = aim(pointer);
        let project = |point| on_screen(camera, placement, point);
        let placed = transform.placed(scene, pointer, &ray, surface, project);
        requests.ask_all(placed.map(|(index, to)| Request::Place(index, to)));
        return;
    }
    let pointer = response.interact_pointer_pos();
    match (pointer.filter(|_| response.dragged()), view.tool.dragged) {
        (Some(pointer), Some(handle)) => {
            let (ray, surface) = aim(pointer);
            let along = Along::of(ui.input(|input| input.modifiers));
            let dragged = insertions.dragged(handle, scene, &ray, surface, along);
            requests.ask_all(dragged.map(|(index, to)| Request::Place(index, to)));
        }
        (Some(_), None) => view.look.pan(rect, size, response.drag_delta()),
        (None, _) => {}
    }
}

/// Where a scene point is on the screen, when the camera's picture lies at `placement`.
fn on_screen(camera: &Camera, placement: Rect, point: glam::Vec3) -> Option<Pos2> {
    let k = &camera.intrinsics;
    let pixel = camera.project(point)?;
    let fraction = vec2(pixel.x / k.width as f32, pixel.y / k.height as f32);
    Some(placement.min + fraction * placement.size())
}

/// Draws the picture itself.
pub fn paint(ui: &Ui, view: &ViewState, rect: Rect, drawn: &Drawn, slot: egui::Id) {
    let paint = PicturePaint {
        slot,
        drawn: drawn.clone(),
        look: view.look.clone(),
        pane: rect,
        selected: view.selection.object,
        tokens: theme::tokens(ui),
    };
    let paint = eframe::egui_wgpu::Callback::new_paint_callback(rect, paint);
    ui.painter().add(paint);
}

/// What lies over the picture: cursor, legend, handles of inserted objects.
pub fn overlay(ui: &Ui, document: &Document, view: &ViewState, rect: Rect, drawn: &Drawn) {
    let tokens = theme::tokens(ui);
    let size = [drawn.picture.width, drawn.picture.height];
    let placement = view.look.placement(rect, size);
    let painter = ui.painter().with_clip_rect(rect.intersect(ui.clip_rect()));

    handles(ui, document, view, rect, placement);

    // The cursor of the pane that the pointer is in, in all the others.
    if let Some(cursor) = view.look.cursor
        && cursor.over != drawn.quantity
    {
        let at = placement.min + cursor.at.to_vec2() * placement.size();
        for (color, width) in [(Color32::from_black_alpha(160), 3.0), (tokens.strong, 1.0)] {
            let stroke = egui::Stroke::new(width, color);
            for arm in [vec2(1.0, 0.0), vec2(0.0, 1.0)]
                .into_iter()
                .flat_map(|a| [a, -a])
            {
                painter.line_segment([at + arm * 3.0, at + arm * 9.0], stroke);
            }
        }
    }
    let shading = drawn.quantity.shading();
    if matches!(shading, Shading::Signed | Shading::Positive) {
        inspect::legend(ui, rect, drawn);
    }
}

/// Handles of inserted objects, and a box around the chosen one while it is placed or moved.
fn handles(ui: &Ui, document: &Document, view: &ViewState, rect: Rect, placement: Rect) {
    let Some((capture, camera)) = document.capture().zip(view.shown.camera(document)) else {
        return;
    };
    let boxed = view.tool.placing || view.tool.dragged.is_some();
    // Nothing covers a result that is only looked at.
    if boxed || ui.rect_contains_pointer(rect) {
        let painter = ui.painter().with_clip_rect(rect.intersect(ui.clip_rect()));
        let project = |point| on_screen(camera, placement, point);
        let (scene, tokens) = (&capture.scene, theme::tokens(ui));
        (document.insertions).draw_handles(&painter, scene, tokens, boxed, project);
    }
}
