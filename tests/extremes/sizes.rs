//! Rooms from a tenth of a millimetre to a thousand kilometres, and far from the origin, against a reference in f64 on
//! the coordinates as they were given.

use crate::{ROOM, SIZE, preset, run, scenes};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use relit::capture::mesh::Mesh;
use relit::inverse::settings::Preset;
use relit::math::frame::Frame;
use relit::math::rng::Stream;
use relit::math::warp;
use relit::scene::Scene;
use relit::scene::geometry::{Ray, offset_origin};
use std::sync::Arc;

/// Rays that pass an edge closer than this fraction of the room's size may go either way.
const MARGIN: f64 = 1e-5;
/// Hit points may be off by this fraction of the room's size: some sixteen roundings of f32.
const POINT: f64 = 1e-6;

/// The room's mesh, `size` times as large and moved by that many of its sizes.
fn mesh(size: f64, moved: f64) -> Mesh {
    let (mut mesh, _) = scenes::lamp_room();
    let shift = DVec3::new(1.0, -0.7, 0.4) * moved;
    mesh.positions
        .iter_mut()
        .for_each(|p| *p = (*p + shift) * size);
    mesh
}

/// All crossings of a ray in f64 on the mesh as given: distance, triangle, and distance to the triangle's nearest edge.
fn crossings(mesh: &Mesh, origin: DVec3, direction: DVec3) -> Vec<(f64, u32, f64)> {
    let mut found = Vec::new();
    for (index, t) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let t = (a - origin).dot(normal) / direction.dot(normal);
        let point = origin + direction * t;
        // Signed distance to each edge, inwards.
        let inside = |p: DVec3, q: DVec3| (q - p).normalize_or_zero().cross(point - p).dot(normal);
        let margin = inside(a, b).min(inside(b, c)).min(inside(c, a));
        if t.is_finite() {
            found.push((t, index as u32, margin));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
}

/// What went wrong among many rays.
#[derive(Debug, Default, PartialEq)]
struct Faults {
    compared: u32,
    leaks: u32,
    other_triangle: u32,
    acne: u32,
    visibility: u32,
    /// Largest distance of a hit point to the exact one, in sizes of the room.
    worst_point: f64,
}

/// Follows rays from wall to wall, and looks from points to points.
fn compare(size: f64, moved: f64, paths: u64) -> Faults {
    let mesh = mesh(size, moved);
    let capture = scenes::capture(mesh.clone(), &[(DVec3::ZERO, DVec3::NEG_Z)], [4, 4]);
    let scene = Scene::new(&capture).expect("the room is sound");
    let each: Vec<Faults> = (0..paths)
        .into_par_iter()
        .map(|i| path(&scene, &mesh, size, i))
        .collect();
    let mut all = Faults::default();
    for one in each {
        all.compared += one.compared;
        all.leaks += one.leaks;
        all.other_triangle += one.other_triangle;
        all.acne += one.acne;
        all.visibility += one.visibility;
        all.worst_point = all.worst_point.max(one.worst_point);
    }
    all
}

fn path(scene: &Scene, mesh: &Mesh, size: f64, index: u64) -> Faults {
    let mut faults = Faults::default();
    let mut stream = Stream::new(81, 0, 0, index);
    // Inside the room and outside the block.
    let start = Vec3::new(0.5, 0.1, 0.5) + warp::uniform_sphere(stream.uniform2()) * 0.2;
    let mut ray = Ray::new(start * size as f32, warp::uniform_sphere(stream.uniform2()));
    let mut before: Option<(u32, Vec3, [Vec3; 3], Vec3)> = None;
    for _ in 0..6 {
        let Some(hit) = scene.intersect(&ray) else {
            faults.leaks += 1;
            return faults;
        };
        let (point, corners) = (scene.point(&hit), scene.corners(hit.triangle));
        // A ray from a flat wall cannot meet that wall again.
        if let Some((triangle, ..)) = before {
            faults.acne += u32::from(triangle == hit.triangle);
        }

        // The nearest crossing in f64, from where the ray started, in the coordinates as given.
        let origin = ray.origin.as_dvec3() + scene.origin;
        let direction = ray.direction.as_dvec3();
        let ahead: Vec<_> = (crossings(mesh, origin, direction).into_iter())
            .filter(|c| c.0 > 0.0 && c.2 > -MARGIN * size)
            .collect();
        let nearest = ahead.first().copied();
        let close = |c: &(f64, u32, f64)| c.2 < MARGIN * size;
        if let Some((t, triangle, _)) = nearest
            && !ahead.iter().any(close)
        {
            faults.compared += 1;
            let exact = origin + direction * t;
            // Where a ray grazes, its own rounding moves the point along the wall.
            let cosine = direction
                .dot(scene.normals[triangle as usize].as_dvec3())
                .abs();
            let off = (point.as_dvec3() + scene.origin - exact).length() * cosine / size;
            if triangle == hit.triangle {
                faults.worst_point = faults.worst_point.max(off);
            } else {
                faults.other_triangle += 1;
            }
        }

        // Whether this point and the one before see a third: that of a random crossing of the room.
        let normal = scene.normals[hit.triangle as usize];
        let normal = if normal.dot(ray.direction) > 0.0 {
            -normal
        } else {
            normal
        };
        if let Some((_, last, last_corners, last_normal)) = before {
            faults.visibility += u32::from(disagree(
                scene,
                mesh,
                size,
                (point, &corners, normal),
                (last, &last_corners, last_normal),
                &mut faults.compared,
            ));
        }
        let wi = Frame::around(normal).to_world(warp::cosine_hemisphere(stream.uniform2()));
        before = Some((hit.triangle, point, corners, normal));
        ray = Ray::new(offset_origin(point, normal, &corners, wi), wi);
    }
    faults
}

type End<'a> = (Vec3, &'a [Vec3; 3], Vec3);

/// Whether visibility between two surface points differs from that in f64.
fn disagree(scene: &Scene, mesh: &Mesh, size: f64, a: End, b: End, compared: &mut u32) -> bool {
    let to = b.0 - a.0;
    let (cos_a, cos_b) = (a.2.dot(to), -b.2.dot(to));
    if cos_a <= 0.05 * to.length() || cos_b <= 0.05 * to.length() {
        return false;
    }
    let origin = a.0.as_dvec3() + scene.origin;
    let direction = to.as_dvec3();
    // The ends lie on their own triangles, within the rounding of points.
    let length = direction.length() / size;
    let ends = 2.0 * MARGIN / length;
    let between: Vec<_> = (crossings(mesh, origin, direction).into_iter())
        .filter(|c| c.0 > ends && c.0 < 1.0 - ends && c.2 > -MARGIN * size)
        .collect();
    if ends > 0.1 || between.iter().any(|c| c.2 < MARGIN * size) {
        return false;
    }
    *compared += 1;
    let ray = Ray::between(
        offset_origin(a.0, a.2, a.1, to),
        offset_origin(b.0, b.2, b.1, -to),
    );
    scene.occluded(&ray) == between.is_empty()
}

#[test]
fn hits_and_visibility_agree_with_f64_at_any_size_and_place() {
    for size in [1e-4, 1e-2, 1.0, 1e3, 1e6] {
        for moved in [0.0, 1e5] {
            let faults = compare(size, moved, 6_000);
            println!("{size:e} m, moved by {moved:e} sizes: {faults:?}");
            assert!(faults.compared > 20_000, "{faults:?}");
            let counts = [
                faults.leaks,
                faults.other_triangle,
                faults.acne,
                faults.visibility,
            ];
            assert_eq!(counts, [0; 4], "{size:e} m, moved by {moved:e}: {faults:?}");
            assert!(
                faults.worst_point < POINT,
                "{size:e} m, moved by {moved:e}: {faults:?}"
            );
        }
    }
}

/// Beyond the sizes that are asked for: where f32 ends.
#[test]
fn the_limits_of_single_precision_lie_far_beyond_any_room() {
    for size in [1e-9, 1e9] {
        let faults = compare(size, 0.0, 500);
        println!("{size:e} m: {faults:?}");
        assert_eq!(
            [
                faults.leaks,
                faults.other_triangle,
                faults.acne,
                faults.visibility
            ],
            [0; 4],
            "{size:e} m"
        );
    }
    // The smallest gap in front of a wall through which light still passes, in sizes of the room.
    for (gap, passes) in [(1e-5, true), (1e-9, false)] {
        let mut mesh = scenes::closed_box(1.0, DVec3::ZERO);
        scenes::lamp(&mut mesh, 0.5, DVec3::new(0.0, 1.0 - 2.0 * gap, 0.0));
        let scene = scenes::scene_of(mesh);
        let mut stream = Stream::new(82, 0, 0, 0);
        let (mut apart, rays) = (0, 2_000);
        for _ in 0..rays {
            let [x, z] = stream.uniform2().map(|u| u - 0.5);
            let target = Vec3::new(0.9 * x, 1.0, 0.9 * z);
            let origin = warp::uniform_sphere(stream.uniform2()) * 0.3;
            let hit = scene.intersect(&Ray::new(origin, target - origin));
            apart += u32::from(hit.is_some_and(|h| scene.object_of[h.triangle as usize] == 6));
        }
        println!(
            "a lamp {gap:e} of the size below the ceiling is the nearer for {apart} of {rays} rays"
        );
        assert_eq!(apart == rays, passes, "gap {gap:e}: {apart}");
    }
}

/// Power-of-two sizes scale f32 without rounding: a threshold with a unit of length would change the estimate.
#[test]
fn estimates_do_not_depend_on_the_unit_of_length_to_the_bit() {
    for chosen in [Preset::Preview, Preset::Balanced] {
        let wanted = run(&ROOM.0, &preset(chosen)).estimate;
        // 1.2e-4 and 1e6.
        for size in [1.0 / 8_192.0, 1_048_576.0] {
            let views = scenes::room_views().map(|(center, target)| (center * size, target * size));
            let capture = scenes::capture(mesh(size, 0.0), &views, SIZE);
            let mut problem = ROOM.0.clone();
            problem.scene = Arc::new(Scene::new(&capture).expect("the room is sound"));
            let found = run(&problem, &preset(chosen)).estimate;
            for (k, (a, b)) in found.objects.iter().zip(&wanted.objects).enumerate() {
                assert_eq!(a.albedo, b.albedo, "{chosen:?}, {size:e} m, object {k}");
                assert_eq!(
                    a.albedo_stderr, b.albedo_stderr,
                    "{chosen:?}, {size:e} m, object {k}"
                );
                assert_eq!(a.emission, b.emission, "{chosen:?}, {size:e} m, object {k}");
            }
        }
    }
}

/// Moved by 1e5 of its sizes the room's f64 coordinates keep ten digits; recentred, all but the last bits agree.
#[test]
fn estimates_do_not_depend_on_the_place() {
    let wanted = run(&ROOM.0, &preset(Preset::Preview)).estimate;
    let shift = DVec3::new(1.0, -0.7, 0.4) * 1e5;
    let views = scenes::room_views().map(|(center, target)| (center + shift, target + shift));
    let capture = scenes::capture(mesh(1.0, 1e5), &views, SIZE);
    let mut problem = ROOM.0.clone();
    problem.scene = Arc::new(Scene::new(&capture).expect("the room is sound"));
    let found = run(&problem, &preset(Preset::Preview)).estimate;
    for (k, (a, b)) in found.objects.iter().zip(&wanted.objects).enumerate() {
        let error = (a.albedo - b.albedo).abs().max_element();
        assert!(
            error < 0.2 * b.albedo_stderr.max_element(),
            "object {k}: {} against {} ± {}",
            a.albedo,
            b.albedo,
            b.albedo_stderr
        );
    }
}
