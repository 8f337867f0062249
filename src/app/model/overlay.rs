//! Lines over the 3D view: the photographs' cameras and the places of inserted objects.

use crate::app::insertion::models::draw_box;
use crate::app::state::App;
use crate::app::theme;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::session::snapshot::OpenCapture;
use egui::{Painter, Pos2, Rect, Stroke, Ui, pos2};
use glam::{Mat4, Vec2, Vec3};

/// Cameras drawn at most.
const CAMERAS: usize = 200;

/// Scene points to points of the screen.
pub(super) struct Projection {
    clip_from_scene: Mat4,
    rect: Rect,
}

impl Projection {
    pub fn new(app: &App, scene: &Scene, rect: Rect) -> Self {
        Self {
            clip_from_scene: app.model.orbit.clip_from_scene(scene),
            rect,
        }
    }

    /// `None` behind the eye.
    pub fn at(&self, point: Vec3) -> Option<Pos2> {
        let clip = self.clip_from_scene * point.extend(1.0);
        (clip.w > 0.0 && clip.z < clip.w).then(|| {
            pos2(
                self.rect.left() + (0.5 + 0.5 * clip.x / clip.w) * self.rect.width(),
                self.rect.top() + (0.5 - 0.5 * clip.y / clip.w) * self.rect.height(),
            )
        })
    }

    fn line(&self, painter: &Painter, a: Vec3, b: Vec3, stroke: Stroke) {
        if let Some((a, b)) = self.at(a).zip(self.at(b)) {
            painter.line_segment([a, b], stroke);
        }
    }
}

/// Draws everything that lies over the mesh.
pub fn draw(ui: &Ui, app: &App, capture: &OpenCapture, rect: Rect) {
    let tokens = theme::tokens(ui);
    let scene = &capture.scene;
    let projection = Projection::new(app, scene, rect);
    let painter = ui.painter().with_clip_rect(rect);
    if app.model.cameras {
        let stride = scene.cameras.len().div_ceil(CAMERAS).max(1);
        for (index, camera) in scene.cameras.iter().enumerate() {
            let chosen = index == app.frame;
            if chosen || index % stride == 0 {
                let stroke = if chosen {
                    Stroke::new(2.0, tokens.accent)
                } else {
                    Stroke::new(1.0, tokens.camera.gamma_multiply(0.8))
                };
                frustum(
                    &projection,
                    &painter,
                    camera,
                    scene.diameter * 0.018,
                    stroke,
                );
            }
        }
    }
    for object in app
        .insertions
        .objects
        .iter()
        .filter(|o| !o.placement.hidden)
    {
        if let Some(corners) = app.insertions.models.corners(&object.placement, scene) {
            let project = |p| projection.at(p);
            draw_box(&painter, &corners, project, tokens.inserted, 1.0);
        }
    }
    app.insertions
        .draw_handles(&painter, scene, tokens, true, |p| projection.at(p));
    let line = &app.model.lasso.line;
    if line.len() > 1 {
        let closed = line.iter().chain(line.first()).copied().collect();
        painter.line(closed, Stroke::new(2.0, tokens.accent));
    }
}

/// Takes the handle of an inserted object under the pointer.
pub fn take_handle(app: &mut App, scene: &Scene, rect: Rect, pointer: Pos2) {
    let projection = Projection::new(app, scene, rect);
    app.insertions
        .take_handle(scene, pointer, |p| projection.at(p));
}

/// The corners of the far end of a camera's pyramid.
fn corners(camera: &Camera, depth: f32) -> [Vec3; 4] {
    let k = &camera.intrinsics;
    let (w, h) = (k.width as f32, k.height as f32);
    [(0.0, 0.0), (w, 0.0), (w, h), (0.0, h)].map(|(x, y)| {
        let ray = camera.ray(Vec2::new(x, y));
        let along = ray.direction.dot(camera.forward()).max(1e-3);
        camera.center + ray.direction * (depth / along)
    })
}

fn frustum(
    projection: &Projection,
    painter: &Painter,
    camera: &Camera,
    depth: f32,
    stroke: Stroke,
) {
    let far = corners(camera, depth);
    for i in 0..4 {
        projection.line(painter, camera.center, far[i], stroke);
        projection.line(painter, far[i], far[(i + 1) % 4], stroke);
    }
}

/// The photograph whose camera is drawn under the pointer.
pub fn camera_at(app: &App, scene: &Scene, rect: Rect, pointer: Pos2) -> Option<usize> {
    if !app.model.cameras {
        return None;
    }
    let projection = Projection::new(app, scene, rect);
    let distance = |camera: &Camera| Some(projection.at(camera.center)?.distance(pointer));
    scene
        .cameras
        .iter()
        .enumerate()
        .filter_map(|(index, camera)| Some((index, distance(camera)?)))
        .filter(|(_, distance)| *distance < 9.0)
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(index, _)| index)
}
