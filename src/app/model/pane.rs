//! The pane of the 3D view: tool line, mouse and keys, and drawing.

use crate::app::controls::{choose, named};
use crate::app::model::gpu::{MeshPaint, SceneUniform};
use crate::app::model::lasso::Lasso;
use crate::app::model::overlay::{self, projection};
use crate::app::model::view::ModelView;
use crate::app::picture::gpu::rgba;
use crate::app::picture::look::fraction;
use crate::app::request::Request;
use crate::app::shown::ray;
use crate::app::theme;
use crate::app::tool::{Clicked, Pick};
use crate::app::view::Parts;
use crate::scene::Scene;
use crate::scene::geometry::{Hit, Ray};
use egui::{Key, PointerButton, Rect, Response, Role, Sense, Ui};
use glam::{Vec2, Vec3};

pub fn pane(ui: &mut Ui, parts: &mut Parts<'_>) {
    theme::strip(ui, |ui| controls(ui, &mut parts.view.model));
    let rect = ui.available_rect_before_wrap();
    let (document, tokens) = (parts.document, theme::tokens(ui));
    let Some(capture) = document.capture() else {
        ui.painter().rect_filled(rect, 0.0, tokens.surround);
        ui.centered_and_justified(|ui| ui.weak(document.nothing_open()));
        return;
    };
    let scene = &capture.scene;
    let pixels = rect.size() * ui.pixels_per_point();
    let orbit = &mut parts.view.model.orbit;
    orbit.size = Vec2::new(pixels.x.max(1.0), pixels.y.max(1.0));
    if orbit.distance == 0.0 {
        orbit.frame(scene, None);
    }

    let response = ui.allocate_rect(rect, Sense::click_and_drag());
    let response = named(response, Role::Image, "3D view picture");
    let before = parts.view.model.orbit.clone();
    let cuts = cut_out(ui, parts, scene, &response);
    let transform = &mut parts.view.tool.transform;
    // A click keeps what the keys began.
    if transform.take_if(|_| response.clicked()).is_none() {
        let transforms = transform.is_some() && response.hovered();
        if !move_object(parts, scene, &response) {
            if !cuts {
                drag(ui, &mut parts.view.model, &response);
            }
            zoom_and_fly(ui, &mut parts.view.model, scene, &response);
        }
        if !transforms {
            click(ui, parts, scene, &response);
        }
    }
    let view = &mut *parts.view;
    if let Some(camera) = &mut view.shown.free
        && before != view.model.orbit
    {
        **camera = view.model.orbit.camera();
    }

    let faces = view.model.faces(ui.ctx(), capture, &document.estimate);
    let Some((surface, colors)) = faces else {
        ui.painter().rect_filled(rect, 0.0, tokens.surround);
        ui.put(rect, egui::Label::new("Preparing the mesh…"));
        return;
    };
    let model = &view.model;
    let uniform = SceneUniform {
        clip_from_scene: model.orbit.clip_from_scene(scene).to_cols_array_2d(),
        eye: model.orbit.eye().to_array(),
        exposure: view.look.exposure.exp2(),
        accent: rgba(tokens.accent),
        background: rgba(tokens.surround),
        selected: view.selection.object.map_or(-1.0, |object| object as f32),
        radiance: u32::from(model.coloring.is_radiance()),
        tone: view.look.tone as u32,
        cull: u32::from(model.cull),
    };
    let paint = MeshPaint {
        surface,
        colors,
        uniform,
        size: model.orbit.size.round().as_uvec2().to_array(),
    };
    let paint = eframe::egui_wgpu::Callback::new_paint_callback(rect, paint);
    ui.painter().add(paint);
    overlay::draw(ui, &document.insertions, view, scene, rect);
}

fn controls(ui: &mut Ui, model: &mut ModelView) {
    ui.horizontal(|ui| {
        choose(ui, "Coloured by", 88.0, &mut model.coloring);
        ui.toggle_value(&mut model.cull, "See inside")
            .on_hover_text("Leaves out faces seen from behind");
        ui.toggle_value(&mut model.cameras, "Cameras")
            .on_hover_text("Shows where the photographs were taken; click one to look through it");
    });
}

/// The ray through a point of the screen.
fn aimed(model: &ModelView, rect: Rect, pointer: egui::Pos2) -> Ray {
    ray(&model.orbit.camera(), fraction(rect, pointer))
}

/// The surface that a ray meets, leaving out what is not drawn.
fn under(model: &ModelView, scene: &Scene, mut ray: Ray) -> Option<Hit> {
    loop {
        let hit = scene.intersect(&ray)?;
        let normal = scene.normals.get(hit.triangle as usize)?;
        if !model.cull || normal.dot(ray.direction) < 0.0 {
            return Some(hit);
        }
        ray = Ray {
            t_min: hit.t * (1.0 + 4.0 * f32::EPSILON),
            ..ray
        };
    }
}

/// Orbits or pans.
fn drag(ui: &Ui, model: &mut ModelView, response: &Response) {
    let drag = response.drag_delta() * ui.pixels_per_point();
    let drag = Vec2::new(drag.x, drag.y);
    let shift = ui.input(|input| input.modifiers.shift);
    if response.dragged_by(PointerButton::Primary) && !shift {
        model.orbit.turn(drag);
    } else if response.dragged() {
        model.orbit.pan(drag);
    }
}

/// Zooms to the pointer and flies, where the pointer is over the view.
fn zoom_and_fly(ui: &Ui, model: &mut ModelView, scene: &Scene, response: &Response) {
    let Some(pointer) = response.hover_pos() else {
        return;
    };
    let ray = aimed(model, response.rect, pointer);
    let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta.y, input.zoom_delta()));
    let factor = (scroll * 0.004).exp() * pinch;
    if factor != 1.0 {
        let point = match under(model, scene, ray) {
            Some(hit) => scene.point(&hit),
            None => ray.origin + ray.direction * model.orbit.distance,
        };
        model.orbit.zoom_to(point, 1.0 / factor, scene);
    }
    if ui.ctx().text_edit_focused() || ui.input(|input| input.modifiers.command) {
        return;
    }
    let (steps, dt, fast) = ui.input(|input| {
        let key = |key| f32::from(u8::from(input.key_down(key)));
        let axis = |plus, minus| key(plus) - key(minus);
        let [right, up] = [axis(Key::D, Key::A), axis(Key::E, Key::Q)];
        let steps = Vec3::new(right, up, axis(Key::W, Key::S));
        (steps, input.stable_dt.min(0.1), input.modifiers.shift)
    });
    if steps != Vec3::ZERO {
        let speed = scene.diameter * if fast { 0.5 } else { 0.15 };
        model.orbit.fly(steps * speed * dt);
        ui.ctx().request_repaint();
    }
}

/// Draws the lasso, and at its end makes what it encloses an object of its own: of the selected objects alone, where any
/// are. False where no lasso is drawn.
fn cut_out(ui: &Ui, parts: &mut Parts<'_>, scene: &Scene, response: &Response) -> bool {
    let view = &mut *parts.view;
    if view.tool.pick != Some(Pick::Lasso) {
        return false;
    }
    if response.drag_stopped_by(PointerButton::Primary) {
        let lasso = std::mem::take(&mut view.model.lasso);
        let selected = view.selection.all();
        let object_of = |face: u32| scene.object_of[face as usize];
        let faces = (0..scene.triangles.len() as u32)
            .filter(|&face| selected.is_empty() || selected.contains(&object_of(face)));
        let project = projection(&view.model.orbit, scene, response.rect);
        let seen = |at| under(&view.model, scene, aimed(&view.model, response.rect, at));
        let enclosed = lasso.enclosed(scene, faces, project, seen);
        view.tool.pick = None;
        parts.requests.ask(Request::CutOut(enclosed));
    }
    if !response.dragged_by(PointerButton::Primary) {
        return false;
    }
    if response.drag_started() {
        view.model.lasso = Lasso::default();
        let press = ui.input(|input| input.pointer.press_origin());
        press.into_iter().for_each(|at| view.model.lasso.draw(at));
    }
    if let Some(pointer) = response.interact_pointer_pos() {
        view.model.lasso.draw(pointer);
    }
    true
}

/// Moves an inserted object by the pointer; false where it has hold of none.
fn move_object(parts: &mut Parts<'_>, scene: &Scene, response: &Response) -> bool {
    let (tool, model) = (&mut parts.view.tool, &parts.view.model);
    let lasso = tool.pick == Some(Pick::Lasso);
    let started = response.drag_started_by(PointerButton::Primary) && !lasso;
    let project = projection(&model.orbit, scene, response.rect);
    let aim = |pointer| {
        let ray = aimed(model, response.rect, pointer);
        let hit = under(model, scene, ray);
        let surface = hit.map(|hit| scene.point(&hit).as_dvec3() + scene.origin);
        (ray, surface)
    };
    let insertions = &parts.document.insertions;
    let (holds, placed) = tool.follow(response, started, insertions, scene, project, aim);
    (parts.requests).ask_all(placed.map(|(index, to)| Request::Place(index, to)));
    holds
}

/// A click looks through a camera, places the chosen object, or selects; a double click turns about what is there.
fn click(ui: &Ui, parts: &mut Parts<'_>, scene: &Scene, response: &Response) {
    let (view, requests) = (&mut *parts.view, &mut *parts.requests);
    let pointer = response.interact_pointer_pos();
    let Some(pointer) = pointer.filter(|_| response.clicked()) else {
        return;
    };
    if !view.tool.is_active()
        && let Some(frame) = overlay::camera_at(&view.model, scene, response.rect, pointer)
    {
        requests.ask(Request::LookThrough(frame));
        return;
    }
    let ray = aimed(&view.model, response.rect, pointer);
    let hit = under(&view.model, scene, ray);
    if let Some(hit) = &hit
        && response.double_clicked()
    {
        let orbit = &mut view.model.orbit;
        orbit.target = orbit.eye() + orbit.forward() * scene.point(hit).distance(orbit.eye());
    }
    let more = ui.input(|input| input.modifiers.command);
    let clicked = hit.and_then(|hit| Clicked::new(scene, &ray, &hit));
    requests.ask(Request::Click(clicked, more));
}
