//! Lines over the 3D view: the photographs' cameras and the places of inserted objects.

use crate::app::insertion::Insertions;
use crate::app::insertion::models::draw_box;
use crate::app::model::orbit::Orbit;
use crate::app::model::view::ModelView;
use crate::app::theme;
use crate::app::view::ViewState;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use egui::{Painter, Pos2, Rect, Stroke, Ui, vec2};
use glam::{Mat4, Vec2, Vec3};

/// Cameras drawn at most.
const CAMERAS: usize = 200;

/// Scene points to points of the screen.
pub(super) struct Projection {
    clip_from_scene: Mat4,
    rect: Rect,
}

impl Projection {
    pub fn new(orbit: &Orbit, scene: &Scene, rect: Rect) -> Self {
        Self {
            clip_from_scene: orbit.clip_from_scene(scene),
            rect,
        }
    }

    /// `None` behind the eye.
    pub fn at(&self, point: Vec3) -> Option<Pos2> {
        let clip = self.clip_from_scene * point.extend(1.0);
        let across = 0.5 * vec2(clip.x, -clip.y) / clip.w * self.rect.size();
        (clip.w > 0.0 && clip.z < clip.w).then(|| self.rect.center() + across)
    }

    fn line(&self, painter: &Painter, a: Vec3, b: Vec3, stroke: Stroke) {
        if let Some((a, b)) = self.at(a).zip(self.at(b)) {
            painter.line_segment([a, b], stroke);
        }
    }
}

/// Draws everything that lies over the mesh.
pub fn draw(ui: &Ui, insertions: &Insertions, view: &ViewState, scene: &Scene, rect: Rect) {
    let (tokens, model) = (theme::tokens(ui), &view.model);
    let projection = Projection::new(&model.orbit, scene, rect);
    let painter = ui.painter().with_clip_rect(rect);
    if model.cameras {
        let stride = scene.cameras.len().div_ceil(CAMERAS).max(1);
        for (index, camera) in scene.cameras.iter().enumerate() {
            let chosen = index == view.shown.frame;
            let stroke = match chosen {
                true => Stroke::new(2.0, tokens.accent),
                false => Stroke::new(1.0, tokens.camera.gamma_multiply(0.8)),
            };
            if chosen || index % stride == 0 {
                let depth = scene.diameter * 0.018;
                frustum(&projection, &painter, camera, depth, stroke);
            }
        }
    }
    let project = |point| projection.at(point);
    for object in insertions.objects.iter().filter(|object| !object.hidden) {
        if let Some(corners) = insertions.models.corners(object, scene) {
            draw_box(&painter, &corners, project, tokens.inserted, 1.0);
        }
    }
    insertions.draw_handles(&painter, scene, tokens, true, project);
    let line = &model.lasso.line;
    if line.len() > 1 {
        let closed = line.iter().chain(line.first()).copied().collect();
        painter.line(closed, Stroke::new(2.0, tokens.accent));
    }
}

/// Draws a camera's pyramid, which is so deep.
fn frustum(
    projection: &Projection,
    painter: &Painter,
    camera: &Camera,
    depth: f32,
    stroke: Stroke,
) {
    let k = &camera.intrinsics;
    let (w, h) = (k.width as f32, k.height as f32);
    let far = [(0.0, 0.0), (w, 0.0), (w, h), (0.0, h)].map(|(x, y)| {
        let ray = camera.ray(Vec2::new(x, y));
        let along = ray.direction.dot(camera.forward()).max(1e-3);
        camera.center + ray.direction * (depth / along)
    });
    for i in 0..4 {
        projection.line(painter, camera.center, far[i], stroke);
        projection.line(painter, far[i], far[(i + 1) % 4], stroke);
    }
}

/// The photograph whose camera is drawn under the pointer.
pub fn camera_at(model: &ModelView, scene: &Scene, rect: Rect, pointer: Pos2) -> Option<usize> {
    let projection = Projection::new(&model.orbit, scene, rect);
    let distance = |camera: &Camera| Some(projection.at(camera.center)?.distance(pointer));
    let cameras = scene.cameras.iter().enumerate().filter(|_| model.cameras);
    cameras
        .filter_map(|(index, camera)| Some((index, distance(camera)?)))
        .filter(|(_, distance)| *distance < 9.0)
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(index, _)| index)
}
