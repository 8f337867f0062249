//! Lines over the 3D view: the photographs' cameras and the places of inserted objects.

use crate::app::insertion::Insertions;
use crate::app::insertion::models::draw_box;
use crate::app::model::orbit::Orbit;
use crate::app::model::view::ModelView;
use crate::app::shown::ray;
use crate::app::theme;
use crate::app::view::ViewState;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use egui::{Pos2, Rect, Stroke, Ui, vec2};
use glam::Vec3;

/// Cameras drawn at most.
const CAMERAS: usize = 200;

/// Maps scene points to points of the screen; to `None` behind the eye.
pub(super) fn projection(
    orbit: &Orbit,
    scene: &Scene,
    rect: Rect,
) -> impl Fn(Vec3) -> Option<Pos2> + use<> {
    let clip_from_scene = orbit.clip_from_scene(scene);
    move |point| {
        let clip = clip_from_scene * point.extend(1.0);
        let across = 0.5 * vec2(clip.x, -clip.y) / clip.w * rect.size();
        (clip.w > 0.0 && clip.z < clip.w).then(|| rect.center() + across)
    }
}

/// Draws everything that lies over the mesh.
pub fn draw(ui: &Ui, insertions: &Insertions, view: &ViewState, scene: &Scene, rect: Rect) {
    let (tokens, model) = (theme::tokens(ui), &view.model);
    let project = projection(&model.orbit, scene, rect);
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
                let eye = project(camera.center);
                let far = corners(camera, scene.diameter * 0.018).map(&project);
                for (i, corner) in far.into_iter().enumerate() {
                    for other in [eye, far[(i + 1) % 4]] {
                        if let Some((a, b)) = corner.zip(other) {
                            painter.line_segment([a, b], stroke);
                        }
                    }
                }
            }
        }
    }
    for object in insertions.objects.iter().filter(|object| !object.hidden) {
        if let Some(corners) = insertions.models.corners(object, scene) {
            draw_box(&painter, &corners, &project, tokens.inserted, 1.0);
        }
    }
    insertions.draw_handles(&painter, scene, tokens, true, project);
    let line = &model.lasso.line;
    if line.len() > 1 {
        let closed = line.iter().chain(line.first()).copied().collect();
        painter.line(closed, Stroke::new(2.0, tokens.accent));
    }
}

/// The corners of a camera's picture at a depth.
fn corners(camera: &Camera, depth: f32) -> [Vec3; 4] {
    [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|at| {
        let ray = ray(camera, at.into());
        let along = ray.direction.dot(camera.forward()).max(1e-3);
        camera.center + ray.direction * (depth / along)
    })
}

/// The photograph whose camera is drawn under the pointer.
pub fn camera_at(model: &ModelView, scene: &Scene, rect: Rect, pointer: Pos2) -> Option<usize> {
    let project = projection(&model.orbit, scene, rect);
    let distance = |camera: &Camera| Some(project(camera.center)?.distance(pointer));
    let cameras = scene.cameras.iter().enumerate().filter(|_| model.cameras);
    cameras
        .filter_map(|(index, camera)| Some((index, distance(camera)?)))
        .filter(|(_, distance)| *distance < 9.0)
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(index, _)| index)
}
