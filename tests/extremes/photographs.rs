//! Photographs that hold next to nothing: every result is defined, and what they cannot tell is said.

use crate::{ROOM, preset, run_briefly, scenes};
use glam::Vec3;
use relit::calibrate::problem::Problem;
use relit::inverse::settings::{Preset, Settings};
use relit::transport::material::Material;
use std::sync::Arc;

fn all_solvers() -> [Settings; 3] {
    [Preset::Preview, Preset::Balanced, Preset::Paper].map(|p| Settings {
        steps: 100,
        ..preset(p)
    })
}

/// The room photographed with pixels of the given size, from the first of its views.
fn photographed(size: [u32; 2], views: usize, samples: u32, materials: &[Material]) -> Problem {
    let (mesh, _) = scenes::lamp_room();
    let capture = scenes::capture(mesh, &scenes::room_views()[..views], size);
    scenes::photographed(&capture, materials, samples, 121)
}

fn with_photographs(problem: &Problem, value: Vec3, saturation: f32) -> Problem {
    let photographs = problem.photographs.iter().map(|photograph| {
        let mut photograph = (**photograph).clone();
        photograph.pixels.fill(value);
        photograph.saturation = Vec3::splat(saturation);
        Arc::new(photograph)
    });
    Problem {
        scene: problem.scene.clone(),
        photographs: photographs.collect(),
    }
}

#[test]
fn photographs_of_one_pixel_are_solved() {
    for views in [1, 6] {
        let problem = photographed([1, 1], views, 64, &ROOM.1);
        for settings in all_solvers() {
            let estimate = run_briefly(&problem, &settings).estimate;
            let seen: u64 = estimate.objects.iter().map(|o| o.seen_pixels).sum();
            println!(
                "{:?}, {views} views: {seen} seen {:?}",
                settings.preset, estimate.objects
            );
            assert!(seen as usize <= views, "{seen}");
        }
    }
}

#[test]
fn one_photograph_of_one_path_a_pixel_is_solved() {
    for (views, samples) in [(1, 64), (1, 1), (6, 1)] {
        let problem = photographed([32, 24], views, samples, &ROOM.1);
        for settings in all_solvers() {
            let estimate = run_briefly(&problem, &settings).estimate;
            println!(
                "{:?}, {views} views of {samples}: {:?}",
                settings.preset, estimate.objects
            );
        }
    }
}

/// Without light there is nothing to reflect: every solver says that albedos are not known, and invents no lamp.
#[test]
fn without_an_emitter_nothing_is_known_and_no_lamp_is_invented() {
    let mut materials = ROOM.1.clone();
    materials.iter_mut().for_each(|m| m.emission = Vec3::ZERO);
    let problem = photographed([32, 24], 6, 4, &materials);
    assert!(
        problem
            .photographs
            .iter()
            .all(|p| p.pixels.iter().all(|&v| v == Vec3::ZERO))
    );
    for settings in all_solvers() {
        for object in run_briefly(&problem, &settings).estimate.objects {
            assert_eq!(
                object.emission,
                Vec3::ZERO,
                "{:?}: {object:?}",
                settings.preset
            );
            assert!(
                !object.albedo_identifiable && !object.identifiable,
                "{:?}: {object:?}",
                settings.preset
            );
        }
    }
}

/// Saturated pixels say "at least this much": nothing is known of what is seen by them alone.
#[test]
fn saturated_photographs_leave_everything_unknown() {
    let problem = with_photographs(&ROOM.0, Vec3::ONE, 1.0);
    for settings in all_solvers() {
        for object in run_briefly(&problem, &settings).estimate.objects {
            assert!(
                !object.albedo_identifiable && !object.identifiable,
                "{:?}: {object:?}",
                settings.preset
            );
        }
    }
}
