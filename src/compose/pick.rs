//! Finds the surface at a pixel, and the surface below a point.

use crate::compose::placement::PlacedObject;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::scene::geometry::{Ray, offset_origin};
use glam::{Vec2, Vec3};

/// Most object corners whose fall is traced.
const MAX_FALLING: usize = 4096;

/// A point of the scene's surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pick {
    /// Position in scene coordinates.
    pub point: Vec3,
    /// Unit normal towards the viewer.
    pub normal: Vec3,
    /// Object index.
    pub object: u32,
}

/// The surface at an image point, in pixels from the top-left corner.
pub fn pick(scene: &Scene, camera: &Camera, pixel: Vec2) -> Option<Pick> {
    let ray = camera.ray(pixel);
    let hit = scene.intersect(&ray)?;
    let normal = scene.normals[hit.triangle as usize];
    let is_back = normal.dot(ray.direction) > 0.0;
    Some(Pick {
        point: scene.point(&hit),
        normal: if is_back { -normal } else { normal },
        object: scene.object_of[hit.triangle as usize],
    })
}

/// The first surface below a point. The ray starts outside of the surface that the point lies on.
pub fn below(scene: &Scene, pick: &Pick) -> Option<Vec3> {
    let down = -scene.up;
    let from = offset_origin(pick.point, pick.normal, &[pick.point; 3], pick.normal);
    let hit = scene.intersect(&Ray::new(from, down))?;
    Some(scene.point(&hit))
}

/// How far an object falls along the scene's down direction until a corner meets a surface. `None` where nothing is below.
///
/// Corners are first raised by `lift`, so that an object may start slightly inside a surface.
pub fn fall(scene: &Scene, object: &PlacedObject, lift: f32) -> Option<f32> {
    let corners = object.corners.len() * 3;
    let stride = corners.div_ceil(MAX_FALLING).max(1);
    let falls = |&corner: &Vec3| {
        let ray = Ray::new(corner + scene.up * lift, -scene.up);
        scene.intersect(&ray).map(|hit| hit.t - lift)
    };
    let chosen = object.corners.iter().flatten().step_by(stride);
    chosen.filter_map(falls).min_by(f32::total_cmp)
}
