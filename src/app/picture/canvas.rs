//! A pane with one picture: zoom and pan shared by all, clicks that select or place, numbers inside large pixels.

use crate::app::insertion::handles::Along;
use crate::app::picture::gpu::PicturePaint;
use crate::app::picture::look::{Cursor, fraction};
use crate::app::picture::quantity::{Quantity, Shading};
use crate::app::picture::{inspect, ramp};
use crate::app::state::{App, Shown};
use crate::app::theme;
use crate::scene::camera::Camera;
use crate::session::snapshot::{Picture, View};
use egui::{Align2, Color32, FontId, Pos2, Rect, Sense, Ui, vec2};
use std::sync::Arc;

/// A picture to draw.
#[derive(Debug, Clone)]
pub struct Drawn {
    /// What it is.
    pub quantity: Quantity,
    /// Its numbers.
    pub picture: Arc<Picture>,
    /// Object index of each of its pixels, where known.
    pub objects: Option<Arc<Vec<u32>>>,
    /// Magnitude at the end of false colours.
    pub range: f32,
}

/// The objects that the pixels of a view show, for a picture of the same view in another size; made once for each view.
#[derive(Debug, Default)]
pub struct Resized(Option<(Indices, [u32; 2], Indices)>);

/// An object's index for each pixel of a picture.
type Indices = Arc<Vec<u32>>;

impl Resized {
    fn of(&mut self, objects: &Indices, from: [u32; 2], to: [u32; 2]) -> Option<Indices> {
        if objects.len() as u64 != u64::from(from[0]) * u64::from(from[1]) {
            return None;
        }
        let known = self.0.as_ref();
        if let Some((_, _, made)) = known.filter(|k| Arc::ptr_eq(&k.0, objects) && k.1 == to) {
            return Some(made.clone());
        }
        let at = |i: u32, axis: usize| {
            (u64::from(i) * u64::from(from[axis]) / u64::from(to[axis].max(1))) as usize
        };
        let row = |y: u32| (0..to[0]).map(move |x| objects[at(y, 1) * from[0] as usize + at(x, 0)]);
        let made = Arc::new((0..to[1]).flat_map(row).collect::<Vec<u32>>());
        self.0 = Some((objects.clone(), to, made.clone()));
        Some(made)
    }
}

impl App {
    /// The pictures of the shown view, once the worker has sent them.
    pub fn view(&self) -> Option<&Arc<View>> {
        let frame = match self.shown {
            Shown::Frame => Some(self.frame),
            Shown::Free(..) => None,
        };
        self.snapshot
            .view
            .as_ref()
            .filter(|view| view.frame == frame)
    }

    /// A picture of the shown view.
    pub fn drawn(&self, quantity: Quantity) -> Option<Drawn> {
        let view = self.view();
        let insertion = self.snapshot.insertion.as_ref().filter(|insertion| {
            matches!(self.shown, Shown::Frame) && insertion.frame == self.frame
        });
        let picture = match quantity {
            // At the size at which it is looked at, where that is known.
            Quantity::Photograph => (insertion.filter(|_| self.composite_needed))
                .map(|insertion| insertion.photograph.clone())
                .or_else(|| view.and_then(|view| view.photograph.clone()))
                .or_else(|| self.photograph()),
            Quantity::Render => view.and_then(|view| view.render.clone()),
            Quantity::Albedo => view.and_then(|view| view.albedo.clone()),
            Quantity::Emission => view.and_then(|view| view.emission.clone()),
            Quantity::Irradiance => self.irradiance.picture(),
            Quantity::Error => view.and_then(|view| view.error.clone()),
            Quantity::StandardError => view.and_then(|view| view.stderr.clone()),
            Quantity::Naive => insertion.map(|insertion| insertion.naive.clone()),
            Quantity::NaiveEstimate => insertion.map(|insertion| insertion.naive_estimate.clone()),
            Quantity::Composite => insertion
                .map(|insertion| insertion.composite.clone())
                .or_else(|| self.photograph()),
        }?;
        let range = match quantity.shading() {
            Shading::Signed | Shading::Positive => {
                let now = ramp::range(&picture, quantity.shading());
                self.scales.borrow_mut().follow(quantity, now)
            }
            _ => 1.0,
        };
        let objects = view.and_then(|view| {
            let (objects, seen) = (view.objects.as_ref()?, view.albedo.as_ref()?);
            let from = [seen.width, seen.height];
            let to = [picture.width, picture.height];
            match from == to {
                true => Some(objects.clone()),
                false => self.resized.borrow_mut().of(objects, from, to),
            }
        });
        Some(Drawn {
            quantity,
            picture,
            objects,
            range,
        })
    }
}

/// Draws the pane of one picture.
pub fn pane(ui: &mut Ui, app: &mut App, quantity: Quantity) {
    let rect = ui.max_rect();
    let shown = if app.look.photograph {
        Quantity::Photograph
    } else {
        quantity
    };
    app.need(shown);
    let Some(drawn) = app.drawn(shown) else {
        missing(ui, app, shown);
        return;
    };
    interact(
        ui,
        app,
        rect,
        &drawn,
        &format!("{} picture", quantity.name()),
    );
    paint(
        ui,
        app,
        rect,
        &drawn,
        egui::Id::unique(("picture", quantity)),
    );
    overlay(ui, app, rect, &drawn);
}

/// Says why there is no picture.
pub fn missing(ui: &mut Ui, app: &App, quantity: Quantity) {
    let text = match quantity {
        _ if app.capture().is_none() => app.nothing_open(),
        Quantity::Photograph => "No photograph was taken from here",
        Quantity::Error if !matches!(app.shown, Shown::Frame) => {
            "No photograph was taken from here"
        }
        Quantity::Composite if !matches!(app.shown, Shown::Frame) => {
            "No photograph was taken from here"
        }
        Quantity::Naive | Quantity::NaiveEstimate => "Compositing…",
        _ => "Waiting for the first picture…",
    };
    let surround = theme::tokens(ui).surround;
    ui.painter().rect_filled(ui.max_rect(), 0.0, surround);
    ui.centered_and_justified(|ui| ui.weak(text));
}

/// Zoom, pan, cursor, selection and placing.
pub fn interact(ui: &mut Ui, app: &mut App, rect: Rect, drawn: &Drawn, name: &str) {
    let size = [drawn.picture.width, drawn.picture.height];
    let response = ui.allocate_rect(rect, Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, name));
    let needed = app.look.placement(rect, size).size().max_elem() * ui.pixels_per_point();
    app.pixels_needed = app.pixels_needed.max(needed);

    if let Some(pointer) = response.hover_pos() {
        let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta.y, input.zoom_delta()));
        let factor = (scroll * 0.005).exp() * pinch;
        if factor != 1.0 {
            app.look.zoom_at(rect, size, pointer, factor);
        }
        let at = fraction(app.look.placement(rect, size), pointer);
        let inside = Rect::from_min_size(Pos2::ZERO, vec2(1.0, 1.0)).contains(at);
        if inside {
            app.look.cursor = Some(Cursor {
                at,
                over: drawn.quantity,
            });
        }
    }
    drag(ui, app, rect, size, &response);
    if response.double_clicked() {
        app.look.fit();
    } else if response.clicked()
        && let Some(pointer) = response.interact_pointer_pos()
    {
        let at = fraction(app.look.placement(rect, size), pointer);
        let more = ui.input(|input| input.modifiers.command);
        app.clicked(app.surface_at(at), more);
    }
    if app.aims() {
        response.on_hover_cursor(egui::CursorIcon::Crosshair);
    }
}

/// Drags a handle of an inserted object, or pans.
fn drag(ui: &Ui, app: &mut App, rect: Rect, size: [u32; 2], response: &egui::Response) {
    let placement = app.look.placement(rect, size);
    let Some((capture, camera)) = app.capture().cloned().zip(app.camera().cloned()) else {
        return;
    };
    if response.drag_started()
        && let Some(press) = ui.input(|input| input.pointer.press_origin())
    {
        let project = |point| on_screen(&camera, placement, point);
        app.insertions.take_handle(&capture.scene, press, project);
    }
    if response.drag_stopped() {
        app.insertions.dragged = None;
    }
    if let Some(pointer) = response
        .interact_pointer_pos()
        .filter(|_| response.dragged())
    {
        let at = fraction(placement, pointer);
        let k = &camera.intrinsics;
        let ray = camera.ray(glam::vec2(at.x * k.width as f32, at.y * k.height as f32));
        let surface = app.surface_at(at).map(|at| at.point);
        let along = Along::of(ui.input(|input| input.modifiers));
        if !(app.insertions).drag_handle(&capture.scene, &ray, surface, along) {
            app.look.pan(rect, size, response.drag_delta());
        }
    }
}

/// Where a scene point is on the screen, when the camera's picture lies at `placement`.
fn on_screen(camera: &Camera, placement: Rect, point: glam::Vec3) -> Option<Pos2> {
    let k = &camera.intrinsics;
    let pixel = camera.project(point)?;
    let fraction = vec2(pixel.x / k.width as f32, pixel.y / k.height as f32);
    Some(placement.min + fraction * placement.size())
}

impl App {
    /// Notes that a picture is shown, for what has to be made for it.
    pub fn need(&mut self, quantity: Quantity) {
        self.composite_needed |= matches!(
            quantity,
            Quantity::Composite | Quantity::Naive | Quantity::NaiveEstimate
        );
        self.render_needed |= matches!(
            quantity,
            Quantity::Render | Quantity::Error | Quantity::Irradiance
        );
        self.irradiance_needed |= quantity == Quantity::Irradiance;
    }

    /// Selects an object of the scene, or where `more` chooses it too, and shows it in the table.
    pub fn select(&mut self, object: Option<u32>, more: bool) {
        self.choose(object, more);
        self.objects.reveal = object.is_some();
    }
}

/// Draws the picture itself.
pub fn paint(ui: &Ui, app: &App, rect: Rect, drawn: &Drawn, slot: egui::Id) {
    let tokens = theme::tokens(ui);
    let paint = PicturePaint {
        objects: drawn.objects.clone(),
        shading: drawn.quantity.shading(),
        range: drawn.range,
        smooth: drawn.quantity.shading() == Shading::Radiance,
        selected: app.selected,
        ..PicturePaint::new(slot, drawn.picture.clone(), rect, &app.look, tokens)
    };
    ui.painter()
        .add(eframe::egui_wgpu::Callback::new_paint_callback(rect, paint));
}

/// What lies over the picture: cursor, legend, numbers, anchors of inserted objects.
pub fn overlay(ui: &Ui, app: &App, rect: Rect, drawn: &Drawn) {
    let tokens = theme::tokens(ui);
    let size = [drawn.picture.width, drawn.picture.height];
    let placement = app.look.placement(rect, size);
    let painter = ui.painter().with_clip_rect(rect.intersect(ui.clip_rect()));

    numbers(&painter, rect, placement, &drawn.picture);
    anchors(ui, app, rect, placement);

    // The cursor of the pane that the pointer is in, in all the others.
    if let Some(cursor) = app.look.cursor
        && cursor.over != drawn.quantity
    {
        let at = placement.min + cursor.at.to_vec2() * placement.size();
        for (color, width) in [(Color32::from_black_alpha(160), 3.0), (tokens.strong, 1.0)] {
            let stroke = egui::Stroke::new(width, color);
            for (from, to) in [
                (vec2(-9.0, 0.0), vec2(-3.0, 0.0)),
                (vec2(3.0, 0.0), vec2(9.0, 0.0)),
                (vec2(0.0, -9.0), vec2(0.0, -3.0)),
                (vec2(0.0, 3.0), vec2(0.0, 9.0)),
            ] {
                painter.line_segment([at + from, at + to], stroke);
            }
        }
    }
    if matches!(
        drawn.quantity.shading(),
        Shading::Signed | Shading::Positive
    ) {
        inspect::legend(ui, rect, drawn);
    }
}

/// Writes each pixel's three numbers into it once it is large enough.
fn numbers(painter: &egui::Painter, rect: Rect, placement: Rect, picture: &Picture) {
    let side = placement.width() / picture.width.max(1) as f32;
    if side < 44.0 {
        return;
    }
    let first = ((rect.min - placement.min) / side)
        .floor()
        .max(vec2(0.0, 0.0));
    let last = ((rect.max - placement.min) / side).ceil();
    let font = FontId::monospace((side * 0.17).min(13.0));
    for j in first.y as u32..(last.y.max(0.0) as u32).min(picture.height) {
        for i in first.x as u32..(last.x.max(0.0) as u32).min(picture.width) {
            let Some(value) = picture.pixels.get((j * picture.width + i) as usize) else {
                continue;
            };
            let center = placement.min + vec2(i as f32 + 0.5, j as f32 + 0.5) * side;
            for (k, (v, color)) in value
                .to_array()
                .into_iter()
                .zip([
                    Color32::from_rgb(255, 120, 110),
                    Color32::from_rgb(120, 235, 120),
                    Color32::from_rgb(130, 175, 255),
                ])
                .enumerate()
            {
                let at = center + vec2(0.0, (k as f32 - 1.0) * font.size * 1.25);
                let text = inspect::number(v);
                // A shadow keeps the numbers readable on any picture.
                painter.text(
                    at + vec2(1.0, 1.0),
                    Align2::CENTER_CENTER,
                    &text,
                    font.clone(),
                    Color32::BLACK,
                );
                painter.text(at, Align2::CENTER_CENTER, text, font.clone(), color);
            }
        }
    }
}

/// Handles of inserted objects, and a box around the chosen one while it is placed or moved.
fn anchors(ui: &Ui, app: &App, rect: Rect, placement: Rect) {
    if let Some((capture, camera)) = app.capture().zip(app.camera()) {
        let painter = ui.painter().with_clip_rect(rect.intersect(ui.clip_rect()));
        let boxed = app.insertions.placing || app.insertions.dragged.is_some();
        // Nothing covers a result that is only looked at.
        if !boxed && !ui.rect_contains_pointer(rect) {
            return;
        }
        app.insertions.draw_handles(
            &painter,
            &capture.scene,
            theme::tokens(ui),
            boxed,
            |point| on_screen(camera, placement, point),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_are_told_in_a_picture_of_another_size() {
        let objects = Arc::new(vec![0, 1, 2, 3]);
        let mut resized = Resized::default();
        let large = resized.of(&objects, [2, 2], [4, 2]).expect("made");
        assert_eq!(*large, [0, 0, 1, 1, 2, 2, 3, 3]);
        let again = resized.of(&objects, [2, 2], [4, 2]).expect("made");
        assert!(Arc::ptr_eq(&large, &again));
        assert!(resized.of(&objects, [3, 2], [4, 2]).is_none());
    }
}
