//! The pane of the 3D view: tool line, mouse and keys, and drawing.

use crate::app::insertion::handles::Along;
use crate::app::model::coloring::Coloring;
use crate::app::model::gpu::{MeshPaint, SceneUniform};
use crate::app::model::lasso::Lasso;
use crate::app::model::overlay::{self, Projection};
use crate::app::pick::{Clicked, Pick};
use crate::app::picture::gpu::rgba;
use crate::app::picture::look::ToneCurve;
use crate::app::state::{App, Shown};
use crate::app::theme;
use crate::scene::Scene;
use crate::scene::geometry::{Hit, Ray};
use egui::{ComboBox, Key, PointerButton, Rect, Response, Sense, Ui};
use glam::{Vec2, Vec3};

/// Draws the pane.
pub fn pane(ui: &mut Ui, app: &mut App) {
    theme::strip(ui).show(ui, |ui| {
        ui.set_min_width(ui.available_width());
        controls(ui, app);
    });
    let rect = ui.available_rect_before_wrap();
    let tokens = theme::tokens(ui);
    let Some(capture) = app.capture().cloned() else {
        ui.painter().rect_filled(rect, 0.0, tokens.surround);
        ui.centered_and_justified(|ui| ui.weak(app.nothing_open()));
        return;
    };
    let scene = &capture.scene;
    let pixels = rect.size() * ui.pixels_per_point();
    app.model.orbit.size = Vec2::new(pixels.x.max(1.0), pixels.y.max(1.0));
    if app.model.orbit.distance == 0.0 {
        app.model.orbit.frame(scene, None);
    }

    let response = ui.allocate_rect(rect, Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, "3D view picture"));
    let before = app.model.orbit.clone();
    steer(ui, app, scene, &response);
    click(ui, app, scene, &response);
    if let Shown::Free(_, count) = app.shown
        && before != app.model.orbit
    {
        app.shown = Shown::Free(Box::new(app.model.orbit.camera(scene)), count + 1);
    }

    let estimate = app.estimate.clone();
    let Some((surface, colors)) = app.model.faces(ui.ctx(), &capture, &estimate) else {
        ui.painter().rect_filled(rect, 0.0, tokens.surround);
        ui.put(rect, egui::Label::new("Preparing the mesh…"));
        return;
    };
    let orbit = &app.model.orbit;
    let uniform = SceneUniform {
        clip_from_scene: orbit.clip_from_scene(scene).to_cols_array_2d(),
        eye: orbit.eye().to_array(),
        exposure: app.look.exposure.exp2(),
        accent: rgba(tokens.accent),
        background: rgba(tokens.surround),
        selected: app.selected.map_or(-1.0, |object| object as f32),
        radiance: u32::from(app.model.coloring.is_radiance()),
        tone: match app.look.tone {
            ToneCurve::None => 0,
            ToneCurve::Reinhard => 1,
            ToneCurve::Filmic => 2,
        },
        cull: u32::from(app.model.cull),
    };
    let paint = MeshPaint {
        surface,
        colors,
        uniform,
        size: [orbit.size.x.round() as u32, orbit.size.y.round() as u32],
    };
    ui.painter()
        .add(eframe::egui_wgpu::Callback::new_paint_callback(rect, paint));
    overlay::draw(ui, app, &capture, rect);
}

fn controls(ui: &mut Ui, app: &mut App) {
    ui.horizontal(|ui| {
        let response = ComboBox::from_id_salt("coloured by")
            .selected_text(app.model.coloring.name())
            .width(88.0)
            .show_ui(ui, |ui| {
                for coloring in Coloring::ALL {
                    ui.selectable_value(&mut app.model.coloring, coloring, coloring.name());
                }
            })
            .response;
        response
            .widget_info(|| egui::WidgetInfo::labeled(egui::Role::ComboBox, true, "Coloured by"));
        ui.toggle_value(&mut app.model.cull, "See inside")
            .on_hover_text("Leaves out faces seen from behind");
        ui.toggle_value(&mut app.model.cameras, "Cameras")
            .on_hover_text("Shows where the photographs were taken; click one to look through it");
    });
}

/// Where the pointer is in the view, in its pixels.
fn pixel(ui: &Ui, rect: Rect, pointer: egui::Pos2) -> Vec2 {
    let offset = (pointer - rect.min) * ui.pixels_per_point();
    Vec2::new(offset.x, offset.y)
}

/// The surface under a pixel, leaving out what is not drawn.
fn under(app: &App, scene: &Scene, pixel: Vec2) -> Option<Hit> {
    let mut ray = app.model.orbit.camera(scene).ray(pixel);
    loop {
        let hit = scene.intersect(&ray)?;
        let normal = scene.normals.get(hit.triangle as usize)?;
        if !app.model.cull || normal.dot(ray.direction) < 0.0 {
            return Some(hit);
        }
        ray = Ray {
            t_min: hit.t * (1.0 + 4.0 * f32::EPSILON),
            ..ray
        };
    }
}

/// Orbit, pan, zoom and fly.
fn steer(ui: &Ui, app: &mut App, scene: &Scene, response: &Response) {
    let per_point = ui.pixels_per_point();
    if app.picking == Some(Pick::Lasso) && response.drag_stopped_by(PointerButton::Primary) {
        cut_out(ui, app, scene, response.rect);
    }
    let drag = response.drag_delta() * per_point;
    let drag = Vec2::new(drag.x, drag.y);
    let shift = ui.input(|input| input.modifiers.shift);
    if move_object(ui, app, scene, response) {
        return;
    }
    if app.picking == Some(Pick::Lasso) && response.dragged_by(PointerButton::Primary) {
        draw_lasso(ui, app, response);
    } else if response.dragged_by(PointerButton::Primary) && !shift {
        app.model.orbit.turn(drag);
    } else if response.dragged() {
        app.model.orbit.pan(drag);
    }
    let Some(pointer) = response.hover_pos() else {
        return;
    };
    let at = pixel(ui, response.rect, pointer);
    let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta.y, input.zoom_delta()));
    let factor = (scroll * 0.004).exp() * pinch;
    if factor != 1.0 {
        let point = match under(app, scene, at) {
            Some(hit) => scene.point(&hit),
            None => {
                let ray = app.model.orbit.camera(scene).ray(at);
                ray.origin + ray.direction * app.model.orbit.distance
            }
        };
        app.model.orbit.zoom_to(point, 1.0 / factor, scene);
    }
    if ui.ctx().text_edit_focused() || ui.input(|input| input.modifiers.command) {
        return;
    }
    let (steps, dt) = ui.input(|input| {
        let axis = |plus, minus| {
            f32::from(u8::from(input.key_down(plus))) - f32::from(u8::from(input.key_down(minus)))
        };
        let steps = Vec3::new(
            axis(Key::D, Key::A),
            axis(Key::E, Key::Q),
            axis(Key::W, Key::S),
        );
        (steps, input.stable_dt.min(0.1))
    });
    if steps != Vec3::ZERO {
        let speed = scene.diameter * if shift { 0.5 } else { 0.15 };
        app.model.orbit.fly(steps * speed * dt);
        ui.ctx().request_repaint();
    }
}

/// Goes on with the line to where the pointer is.
fn draw_lasso(ui: &Ui, app: &mut App, response: &Response) {
    if response.drag_started() {
        app.model.lasso = Lasso::default();
        let press = ui.input(|input| input.pointer.press_origin());
        press.into_iter().for_each(|at| app.model.lasso.draw(at));
    }
    if let Some(pointer) = response.interact_pointer_pos() {
        app.model.lasso.draw(pointer);
    }
}

/// Makes what the line encloses an object of its own: of the chosen objects alone, where any are.
fn cut_out(ui: &Ui, app: &mut App, scene: &Scene, rect: Rect) {
    let lasso = std::mem::take(&mut app.model.lasso);
    let chosen = app.chosen_objects();
    let object_of = |face: u32| scene.object_of[face as usize];
    let faces = (0..scene.triangles.len() as u32)
        .filter(|&face| chosen.is_empty() || chosen.contains(&object_of(face)));
    let projection = Projection::new(app, scene, rect);
    let seen = |at| under(app, scene, pixel(ui, rect, at));
    let enclosed = lasso.enclosed(scene, faces, |point| projection.at(point), seen);
    app.picking = None;
    app.cut_out(enclosed);
}

/// Drags a handle of an inserted object; false while none is held.
fn move_object(ui: &Ui, app: &mut App, scene: &Scene, response: &Response) -> bool {
    if app.picking == Some(Pick::Lasso) {
        return false;
    }
    if response.drag_started_by(PointerButton::Primary)
        && let Some(press) = ui.input(|input| input.pointer.press_origin())
    {
        overlay::take_handle(app, scene, response.rect, press);
    }
    if response.drag_stopped() {
        app.insertions.dragged = None;
    }
    let Some(pointer) = response
        .interact_pointer_pos()
        .filter(|_| response.dragged())
    else {
        return false;
    };
    let at = pixel(ui, response.rect, pointer);
    let ray = app.model.orbit.camera(scene).ray(at);
    let surface = under(app, scene, at).map(|hit| scene.point(&hit).as_dvec3() + scene.origin);
    let along = Along::of(ui.input(|input| input.modifiers));
    app.insertions.drag_handle(scene, &ray, surface, along)
}

/// A click looks through a camera, places the chosen object, or selects; a double click turns about what is there.
fn click(ui: &Ui, app: &mut App, scene: &Scene, response: &Response) {
    let Some(pointer) = response
        .interact_pointer_pos()
        .filter(|_| response.clicked())
    else {
        return;
    };
    if !app.aims()
        && let Some(frame) = overlay::camera_at(app, scene, response.rect, pointer)
    {
        app.jump_to_frame(frame);
        return;
    }
    let at = pixel(ui, response.rect, pointer);
    let hit = under(app, scene, at);
    if let Some(hit) = &hit
        && response.double_clicked()
    {
        let orbit = &mut app.model.orbit;
        orbit.target = orbit.eye() + orbit.forward() * scene.point(hit).distance(orbit.eye());
    }
    let ray = app.model.orbit.camera(scene).ray(at);
    let more = ui.input(|input| input.modifiers.command);
    app.clicked(hit.and_then(|hit| Clicked::new(scene, &ray, &hit)), more);
}
