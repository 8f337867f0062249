//! A room scaled, or with a distant outlier, and the accuracy of hit points there.

use crate::math::stats::quantile;
use crate::room::Room;
use crate::room::cameras::cameras;
use crate::scene::Scene;
use crate::scene::visibility::NOTHING;
use crate::transport::material::Material;
use glam::{DVec3, Vec2, Vec3};

/// Quantile of the reported error over rays.
const QUANTILE: f64 = 0.99;

/// Changes a room by a parameter. Returns the room, and the size that errors are relative to.
pub type Change = fn(&Room, f64) -> (Room, f64);

/// Longest side of a room's bounding box.
fn size(room: &Room) -> f64 {
    let (low, high) = room.mesh.bounds();
    (high - low).max_element()
}

/// The room scaled by `factor`.
pub fn scaled(room: &Room, factor: f64) -> (Room, f64) {
    let mut room = room.clone();
    room.mesh.positions.iter_mut().for_each(|p| *p *= factor);
    (room.views.iter_mut()).for_each(|view| view.pose.center *= factor);
    let size = size(&room);
    (room, size)
}

/// The room with a small triangle at `distance` times its size, like a stray triangle of a scan.
pub fn with_outlier(room: &Room, distance: f64) -> (Room, f64) {
    let mut room = room.clone();
    let size = size(&room);
    let (low, high) = room.mesh.bounds();
    let first = room.mesh.positions.len() as u32;
    let middle = (low + high) * 0.5;
    let far = middle + DVec3::new(0.6, 0.48, 0.64) * (size * distance);
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y].map(|p| far + p * (0.1 * size));
    room.mesh.positions.extend(corners);
    room.mesh.triangles.push([first, first + 1, first + 2]);
    room.mesh.object_of.push(room.mesh.objects.len() as u32);
    room.mesh.objects.push("speck".to_owned());
    if !room.mesh.corner_uvs.is_empty() {
        room.mesh.corner_uvs.push([Vec2::ZERO; 3]);
    }
    room.materials
        .push(Material::diffuse(Vec3::splat(0.5), Vec3::ZERO));
    (room, size)
}

/// Whether the central ray of each pixel of each camera hits a surface.
pub fn meets(scene: &Scene) -> Vec<bool> {
    let pixels = scene.ids().triangles.iter().flatten();
    pixels.map(|&triangle| triangle != NOTHING).collect()
}

/// Error of the hit points of the pixels' central rays in units of `size` (99 % quantile), compared in f64 with the
/// intersection of ray and triangle plane. `met` are the pixels with a hit in the original room; one that hits
/// nothing now has error 1.
pub fn hit_error(room: &Room, scene: &Scene, met: &[bool], size: f64) -> f64 {
    let lens = scene.cameras.first().map(|camera| camera.intrinsics);
    let [width, height] = lens.map_or([0; 2], |lens| [lens.width, lens.height]);
    let exact = cameras(&room.views, [width, height]);
    let mut errors = Vec::new();
    let mut met = met.iter();
    for (camera, (lens, pose)) in scene.cameras.iter().zip(&exact) {
        for pixel in 0..camera.pixels() {
            if met.next() != Some(&true) {
                continue;
            }
            let at = camera.corner(pixel) + 0.5;
            let Some(hit) = scene.intersect(&camera.ray(at)) else {
                errors.push(1.0);
                continue;
            };
            let corners = room.mesh.triangles[hit.triangle as usize];
            let [a, b, c] = corners.map(|i| room.mesh.positions[i as usize]);
            let normal = (b - a).cross(c - a);
            let on_plane = lens.normalized(at.as_dvec2());
            let direction = pose.rotation * DVec3::new(on_plane.x, -on_plane.y, -1.0);
            let t = (a - pose.center).dot(normal) / direction.dot(normal);
            let found = scene.point(&hit).as_dvec3() + scene.origin;
            errors.push((pose.center + direction * t - found).length() / size);
        }
    }
    quantile(&mut errors, QUANTILE).unwrap_or(f64::NAN)
}
