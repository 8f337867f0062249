//! What of the photographs enters a fit, and what is kept to test it.

use crate::scenes;
use glam::{DVec3, Vec2, Vec3};
use relit::calibrate::gbuffer::{GBuffer, SurfacePoint};
use relit::calibrate::held_out::HoldOut;
use relit::calibrate::measured_radiance::MeasuredRadiance;
use relit::calibrate::problem::Problem;
use relit::inverse::estimate::{Estimate, ObjectEstimate};
use relit::inverse::loss::LossProbe;
use relit::inverse::paths::clusters::{Cluster, cluster};
use relit::inverse::settings::Settings;
use std::collections::BTreeSet;
use std::sync::Arc;

const SIZE: [u32; 2] = [48, 36];
const LAMP: u32 = 6;

/// The room in all views, photographed with little care.
fn room() -> Problem {
    let (mesh, materials) = scenes::lamp_room();
    let capture = scenes::capture(mesh, &scenes::room_views(), SIZE);
    scenes::photographed(&capture, &materials, 4, 61)
}

fn gbuffer(problem: &Problem) -> GBuffer {
    GBuffer::new(
        problem,
        HoldOut::from(&Settings::default()),
        Settings::default().seed,
        usize::MAX,
    )
}

/// The problem with every pixel that fits `which` (frame, pixel) replaced.
fn replaced(problem: &Problem, color: Vec3, which: impl Fn(u32, u32) -> bool) -> Problem {
    let photographs = problem.photographs.iter().enumerate().map(|(frame, p)| {
        let mut photograph = (**p).clone();
        for (pixel, value) in photograph.pixels.iter_mut().enumerate() {
            if which(frame as u32, pixel as u32) {
                *value = color;
            }
        }
        Arc::new(photograph)
    });
    Problem {
        scene: problem.scene.clone(),
        photographs: photographs.collect(),
    }
}

#[test]
fn each_object_is_counted_where_the_middle_of_a_pixel_sees_it() {
    let problem = room();
    let gbuffer = gbuffer(&problem);
    let mut seen = vec![0u64; problem.scene.objects.len()];
    for camera in &problem.scene.cameras {
        for pixel in 0..SIZE[0] * SIZE[1] {
            let place = Vec2::new((pixel % SIZE[0]) as f32, (pixel / SIZE[0]) as f32) + 0.5;
            let hit = problem.scene.intersect(&camera.ray(place));
            let hit = hit.expect("the room is closed");
            seen[problem.scene.object_of[hit.triangle as usize] as usize] += 1;
        }
    }
    assert_eq!(gbuffer.seen, seen);
    assert!(seen.iter().all(|&n| n > 50), "{seen:?}");

    // A keyed quarter of the pixels gives the counts scaled up, within 5 binomial deviations.
    let total: u64 = seen.iter().sum();
    let quarter = GBuffer::new(
        &problem,
        HoldOut::from(&Settings::default()),
        Settings::default().seed,
        total as usize / 4,
    );
    for (&scaled, &n) in quarter.seen.iter().zip(&seen) {
        let deviation = (n as f64 * 0.25 * 0.75).sqrt() * 4.0;
        assert!(
            (scaled as f64 - n as f64).abs() < 5.0 * deviation,
            "{scaled} of {n}"
        );
    }
}

#[test]
fn pure_pixels_see_one_surface_of_one_object_and_most_are_pure() {
    let gbuffer = gbuffer(&room());
    let pure = gbuffer.pixels.iter().filter(|p| p.pure).count();
    assert!(pure * 10 > gbuffer.pixels.len() * 7, "{pure}");
    for pixel in gbuffer.pixels.iter().filter(|p| p.pure) {
        let points = pixel
            .points
            .map(|p| p.expect("a pure pixel meets a surface"));
        assert!(points.iter().all(|p| p.object == pixel.object));
        assert!(points.iter().all(|p| p.normal.dot(points[0].normal) > 0.8));
    }
    let mixed = |p: &&relit::calibrate::gbuffer::GBufferPixel| {
        p.points.iter().flatten().any(|q| q.object != p.object)
    };
    assert!(gbuffer.pixels.iter().filter(mixed).count() > 100);
}

/// No ray anywhere in a pixel that is inside an object leaves it, on a mesh whose edges are straight.
#[test]
fn inside_an_object_no_part_of_a_pixel_sees_another() {
    let problem = room();
    let gbuffer = gbuffer(&problem);
    let inside: Vec<_> = gbuffer.pixels.iter().filter(|p| p.inside).collect();
    assert!(inside.len() * 2 > gbuffer.pixels.len(), "{}", inside.len());
    for pixel in inside {
        assert!(pixel.pure);
        let corner = Vec2::new(
            (pixel.pixel % SIZE[0]) as f32,
            (pixel.pixel / SIZE[0]) as f32,
        );
        for part in 0..64 {
            let offset = Vec2::new((part % 8) as f32 + 0.5, (part / 8) as f32 + 0.5) / 8.0;
            let ray = problem.scene.cameras[pixel.frame as usize].ray(corner + offset);
            let hit = problem.scene.intersect(&ray).expect("the room is closed");
            let object = problem.scene.object_of[hit.triangle as usize];
            assert_eq!(object, pixel.object, "{pixel:?}");
        }
    }
}

/// Points on planes are found without rays; they are where rays would have met the mesh.
#[test]
fn points_lie_where_the_quarters_of_their_pixel_see_the_mesh() {
    let problem = room();
    let gbuffer = gbuffer(&problem);
    let scene = &problem.scene;
    for pixel in &gbuffer.pixels {
        let camera = &scene.cameras[pixel.frame as usize];
        let corner = Vec2::new(
            (pixel.pixel % SIZE[0]) as f32,
            (pixel.pixel / SIZE[0]) as f32,
        );
        for (quarter, point) in pixel.points.iter().enumerate() {
            let point = point.expect("the room is closed");
            let place = camera.project(point.point).expect("in the picture") - corner;
            let low = Vec2::new((quarter % 2) as f32, (quarter / 2) as f32) * 0.5;
            let inside = (place - low).min_element() > -1e-3 && (place - low).max_element() < 0.501;
            assert!(inside, "{place} in quarter {quarter}");
            let hit = scene
                .intersect(&camera.ray(place + corner))
                .expect("closed");
            let off = (scene.point(&hit) - point.point).length() / scene.diameter;
            assert!(off < 1e-3, "{off}");
            assert!((point.point - camera.center).dot(point.normal) <= 0.0);
        }
    }
    let all = gbuffer.pixels.len() as u64 * 5;
    assert!(gbuffer.rays < all * 3 / 4, "{} of {all}", gbuffer.rays);
}

#[test]
fn footprints_grow_with_the_room() {
    let footprint = |scale: f64| {
        let (mut mesh, _) = scenes::lamp_room();
        mesh.positions.iter_mut().for_each(|p| *p *= scale);
        let views = scenes::room_views().map(|(center, target)| (center * scale, target * scale));
        let capture = scenes::capture(mesh, &views, SIZE);
        f64::from(
            gbuffer(&scenes::photographed(
                &capture,
                &scenes::lamp_room().1,
                1,
                0,
            ))
            .footprint,
        )
    };
    let ratio = footprint(1e3) / footprint(1.0);
    assert!((ratio / 1e3 - 1.0).abs() < 1e-3, "{ratio}");
}

#[test]
fn clusters_hold_each_fitted_pixel_at_most_once_and_its_mean_colour() {
    let problem = room();
    let gbuffer = gbuffer(&problem);
    let clusters = cluster(&problem, &gbuffer, usize::MAX);
    let mut seen = BTreeSet::new();
    for c in &clusters {
        let photograph = &problem.photographs[c.frame as usize];
        let sum: DVec3 = c
            .pixels
            .iter()
            .map(|&p| photograph.pixels[p as usize].as_dvec3())
            .sum();
        let mean = (sum / c.pixels.len() as f64).as_vec3();
        assert!((c.measured - mean).length() <= 1e-6 * mean.length());
        let weight = c.weight(DVec3::ZERO);
        assert!(weight.is_finite() && weight.min_element() > 0.0);
        for &pixel in &c.pixels {
            assert!(seen.insert((c.frame, pixel)), "{pixel} is fitted twice");
            assert!(!HoldOut::from(&Settings::default()).contains(c.frame, pixel));
        }
    }
    // A bound on the pixels is kept, but for the small objects.
    let few = cluster(&problem, &gbuffer, 1_000);
    let kept: usize = few.iter().map(|c| c.pixels.len()).sum();
    assert!(kept < seen.len() / 2, "{kept} of {}", seen.len());
    let objects: BTreeSet<u32> = few.iter().map(|c| c.object).collect();
    assert_eq!(objects.len(), problem.scene.objects.len());
}

#[test]
fn held_out_pixels_enter_neither_clusters_nor_the_light_field() {
    let problem = room();
    for settings in [
        Settings::default(),
        Settings {
            hold_out: 3,
            ..Settings::default()
        },
        Settings {
            held_out: 0.6,
            ..Settings::default()
        },
    ] {
        let absurd = replaced(&problem, Vec3::splat(1e6), |frame, pixel| {
            HoldOut::from(&settings).contains(frame, pixel)
        });
        let look = |problem: &Problem| -> (Vec<Cluster>, Vec<Option<Vec3>>, Vec<Option<Vec3>>) {
            let gbuffer =
                GBuffer::new(problem, HoldOut::from(&settings), settings.seed, usize::MAX);
            let measured = MeasuredRadiance::new(problem, &gbuffer);
            let points = gbuffer.pixels.iter().flat_map(|p| p.points).flatten();
            let field = points.map(|point| measured.at(&point)).collect();
            (
                cluster(problem, &gbuffer, 5_000),
                field,
                measured.object_means,
            )
        };
        assert_eq!(look(&problem), look(&absurd));
        // Were they not held out, they would be noticed.
        let noticed = replaced(&problem, Vec3::splat(1e6), |frame, pixel| {
            !HoldOut::from(&settings).contains(frame, pixel) && pixel % 7 == 0
        });
        assert_ne!(look(&problem).0, look(&noticed).0);
    }
}

#[test]
fn masked_pixels_are_not_even_looked_at() {
    let mut problem = room();
    let mut masked = (*problem.photographs[2]).clone();
    masked.usable = (0..masked.pixels.len()).map(|p| p % 2 == 0).collect();
    problem.photographs[2] = Arc::new(masked);
    let gbuffer = gbuffer(&problem);
    assert!(
        gbuffer
            .pixels
            .iter()
            .all(|p| p.frame != 2 || p.pixel % 2 == 0)
    );
    let counted = gbuffer.pixels.iter().filter(|p| p.object == 3).count();
    assert_eq!(gbuffer.seen[3], counted as u64);
    let [width, height] = SIZE.map(|n| n as usize);
    assert_eq!(
        gbuffer.pixels.len(),
        6 * width * height - width * height / 2
    );
}

/// The lamp reflects nothing, so its photographs hold its emission exactly; no camera sees it from above.
#[test]
fn the_light_field_knows_the_lamp_from_below_and_nothing_of_its_back() {
    let problem = room();
    let gbuffer = gbuffer(&problem);
    let measured = MeasuredRadiance::new(&problem, &gbuffer);
    let at = |normal: Vec3| SurfacePoint {
        point: Vec3::new(0.1, 0.9, -0.1) - problem.scene.origin.as_vec3(),
        normal,
        object: LAMP,
    };
    let below = measured.at(&at(Vec3::NEG_Y)).expect("the lamp is seen");
    assert!(
        (below - Vec3::new(14.0, 12.0, 9.0)).length() < 1e-4,
        "{below}"
    );
    assert_eq!(measured.at(&at(Vec3::Y)), None);
    let mean = measured.object_means[LAMP as usize].expect("the lamp is seen");
    // The mean also holds pixels whose edges missed the lamp.
    assert!((mean - below).length() < 0.01 * below.length());
    // Another object at the same place is another cell.
    let other = SurfacePoint {
        object: 0,
        ..at(Vec3::NEG_Y)
    };
    assert_eq!(measured.at(&other), None);
}

/// A box that emits and does not reflect looks the same through every path, so the loss is known exactly.
#[test]
fn losses_are_mean_absolute_differences_apart_for_fitted_and_held_out_pixels() {
    let views = &scenes::room_views()[..2];
    let capture = scenes::capture(scenes::closed_box(1.0, DVec3::ZERO), views, SIZE);
    let emission = Vec3::new(1.0, 2.0, 3.0);
    let material = relit::transport::material::Material::diffuse(Vec3::ZERO, emission);
    let problem = scenes::photographed(&capture, &vec![material; 6], 1, 0);
    let settings = Settings::default();
    let brighter = replaced(
        &problem,
        emission + Vec3::new(0.3, 0.6, 0.0),
        |frame, pixel| HoldOut::from(&settings).contains(frame, pixel),
    );
    let object = ObjectEstimate {
        emission,
        ..ObjectEstimate::default()
    };
    let estimate = Estimate {
        objects: vec![object; 6],
        ..Estimate::default()
    };
    let losses = LossProbe::new(&brighter, &settings, 100, 2, 5).measure(&brighter, &estimate);
    assert!(losses.train.is_some_and(|l| l < 1e-6), "{losses:?}");
    assert!(
        losses.held_out.is_some_and(|l| (l - 0.3).abs() < 1e-5),
        "{losses:?}"
    );
    assert!(losses.cast.rays >= 400);
    // Nothing is held out: there is nothing to measure.
    let settings = Settings {
        held_out: 0.0,
        ..settings
    };
    let losses = LossProbe::new(&problem, &settings, 100, 2, 5).measure(&problem, &estimate);
    assert_eq!(losses.held_out, None);
}
