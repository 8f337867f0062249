//! Free places on the floor of a scene: level, unoccupied, and seen by cameras.

use crate::math::frame::Frame;
use crate::scene::Scene;
use crate::scene::geometry::Ray;
use glam::{DAffine3, DQuat, DVec3, Vec2, Vec3};
use rayon::prelude::*;
use std::f32::consts::TAU;

/// Smallest cosine between up and the normal of level floor.
const LEVEL: f32 = 0.98;
/// The same for triangles that determine the up direction; the cameras' mean up may be tilted.
const NEARLY_LEVEL: f32 = 0.95;
/// Columns of a picture at which the floor is sampled.
const ACROSS: u32 = 24;
/// Directions in which a place must be free.
const AROUND: usize = 16;
/// Heights at which it must be free, relative to the cylinder's.
const HEIGHTS: [f32; 3] = [0.05, 0.5, 1.0];
/// Largest step of the floor around a place, relative to the cylinder's height.
const STEP: f32 = 0.03;

#[derive(Debug, Clone, Copy)]
pub struct Cylinder {
    pub radius: f32,
    pub height: f32,
}

/// The up direction: mean normal of nearly level triangles, weighted by area; that of the cameras if there are none.
pub fn up(scene: &Scene) -> Vec3 {
    let triangles = scene.normals.iter().zip(&scene.areas);
    let level = triangles.filter(|(normal, _)| normal.dot(scene.up) >= NEARLY_LEVEL);
    let sum: DVec3 = level
        .map(|(normal, &area)| normal.as_dvec3() * f64::from(area))
        .sum();
    sum.as_vec3().normalize_or(scene.up)
}

/// The rotation that stands a model of y up on the floor.
pub fn upright(up: Vec3) -> DAffine3 {
    let up = up.as_dvec3().normalize_or(DVec3::Y);
    DAffine3::from_quat(DQuat::from_rotation_arc(DVec3::Y, up))
}

/// Up to `count` points on the floor where the cylinder can stand, without overlap; those seen by most cameras come first.
pub fn places(scene: &Scene, up: Vec3, cylinder: Cylinder, count: usize) -> Vec<Vec3> {
    let mut free: Vec<(usize, Vec3)> = (ground(scene, up).into_par_iter())
        .filter(|&place| is_free(scene, up, cylinder, place))
        .map(|place| {
            let middle = place + up * (0.5 * cylinder.height);
            (seen_by(scene, middle), place)
        })
        .filter(|(cameras, _)| *cameras > 0)
        .collect();
    // The sort is stable: equal places stay in the order of frames and pixels.
    free.sort_by_key(|(cameras, _)| std::cmp::Reverse(*cameras));
    let mut chosen: Vec<Vec3> = Vec::new();
    for (_, place) in free {
        let apart = |other: &Vec3| other.distance(place) > 2.0 * cylinder.radius;
        if chosen.len() < count && chosen.iter().all(apart) {
            chosen.push(place);
        }
    }
    chosen
}

/// Points on level floor that the cameras see.
fn ground(scene: &Scene, up: Vec3) -> Vec<Vec3> {
    let mut points = Vec::new();
    for camera in &scene.cameras {
        let lens = &camera.intrinsics;
        let step = lens.width.div_ceil(ACROSS).max(1) as usize;
        let rows = (0..lens.height).step_by(step);
        for (x, y) in rows.flat_map(|y| (0..lens.width).step_by(step).map(move |x| (x, y))) {
            let ray = camera.ray(Vec2::new(x as f32, y as f32) + 0.5);
            let level = |triangle: u32| {
                let normal = scene.normals[triangle as usize];
                normal.dot(up) >= LEVEL && normal.dot(ray.direction) < 0.0
            };
            let hit = scene.intersect(&ray);
            points.extend(hit.filter(|h| level(h.triangle)).map(|h| scene.point(&h)));
        }
    }
    points
}

/// Whether a place is free: no camera within the cylinder's height, nothing on rays through it, and level floor below its rim.
fn is_free(scene: &Scene, up: Vec3, cylinder: Cylinder, place: Vec3) -> bool {
    let Cylinder { radius, height } = cylinder;
    let frame = Frame::around(up);
    let step = STEP * height;
    let middle = place + up * (0.5 * height);
    let mut cameras = scene.cameras.iter();
    let clear = cameras.all(|camera| camera.center.distance(middle) > height);
    clear
        && (0..AROUND).all(|index| {
            let angle = TAU * index as f32 / AROUND as f32;
            let outwards = frame.to_world(Vec3::new(angle.cos(), angle.sin(), 0.0));
            let rim = place + outwards * radius;
            let free = HEIGHTS.iter().all(|fraction| {
                let middle = place + up * (fraction * height);
                !scene.occluded(&Ray::between(middle, middle + outwards * radius))
            });
            let above = rim + up * step;
            let free_above = !scene.occluded(&Ray::between(above, rim + up * height));
            let ground = scene.occluded(&Ray::between(above, rim - up * step));
            free && free_above && ground
        })
}

/// Number of cameras that see a point.
fn seen_by(scene: &Scene, point: Vec3) -> usize {
    let seen = scene.cameras.iter().filter(|camera| {
        camera.project(point).is_some() && !scene.occluded(&Ray::between(camera.center, point))
    });
    seen.count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::experiments::box_room::standard;

    #[test]
    fn places_are_on_the_floor_or_the_block_apart_and_free() {
        let lit = standard().lit([48, 36]).expect("a scene");
        let scene = &*lit.scene;
        let up = up(scene);
        assert!(up.distance(Vec3::Y) < 1e-6, "{up}");
        let small = Cylinder {
            radius: 0.15,
            height: 0.4,
        };
        let found = places(scene, up, small, 3);
        assert_eq!(found.len(), 3, "{found:?}");
        let floor = -scene.origin.y as f32;
        for (index, place) in found.iter().enumerate() {
            assert!(place.y - floor < 0.7, "{place}");
            assert!(place.x.abs() + 0.15 < 1.0 && place.z.abs() + 0.15 < 1.0);
            let apart = found[..index].iter().map(|other| other.distance(*place));
            assert!(apart.fold(f32::INFINITY, f32::min) > 0.3);
            // Neither beside the block nor through its side.
            let block = (place.x + 0.35).abs() < 0.4 && (place.z + 0.3).abs() < 0.35;
            assert!(!block || place.y - floor > 0.5, "{place}");
        }
        // Nothing as wide as the room fits.
        let wide = Cylinder {
            radius: 0.95,
            height: 0.4,
        };
        assert!(places(scene, up, wide, 1).is_empty());
    }
}
