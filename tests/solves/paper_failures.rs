//! The failures that the paper shows of itself (its Fig. 6), each on a small scene, and what is done about it. Highlights that go
//! into albedos are in `lobes.rs`.

use crate::scenes;
use glam::{DVec3, Vec3};
use relit::calibrate::problem::Problem;
use relit::inverse::estimate::Estimate;
use relit::inverse::settings::{Preset, Settings};
use relit::scene::Scene;
use relit::transport::material::Material;
use relit::transport::surroundings::Surroundings;
use std::sync::Arc;

const FLOOR: usize = 2;

/// The lamp room's photographs, beside a mesh that lacks the objects of the given names; and the materials of the rest.
fn room_without(names: &[&str]) -> (Problem, Vec<Material>) {
    let more = [
        ([0.0, 0.3, 0.9], [0.0, -0.4, -1.0]),
        ([-0.9, 0.4, 0.0], [0.8, -0.6, 0.1]),
        ([0.0, -0.6, 0.2], [0.2, 1.0, -0.1]),
    ]
    .map(|(center, target)| (DVec3::from_array(center), DVec3::from_array(target)));
    let views: Vec<_> = scenes::room_views().into_iter().chain(more).collect();
    let size = [48, 36];
    let (whole, materials) = scenes::lamp_room();
    let whole = scenes::capture(whole, &views, size);
    let photographs = scenes::photographed(&whole, &materials, 256, 67).photographs;
    let (mesh, materials) = scenes::without(scenes::lamp_room(), names);
    let rest = scenes::capture(mesh, &views, size);
    let scene = Arc::new(Scene::new(&rest).expect("the test scene is sound"));
    (Problem { scene, photographs }, materials)
}

/// Errors of albedo relative to it, of all but lamps.
fn errors(estimate: &Estimate, materials: &[Material]) -> Vec<f32> {
    let surfaces = estimate.objects.iter().zip(materials);
    surfaces
        .filter(|(_, material)| material.emission == Vec3::ZERO)
        .map(|(object, material)| {
            let truth = scenes::albedo(material);
            (object.albedo - truth).length() / truth.length()
        })
        .collect()
}

fn median(mut errors: Vec<f32>) -> f32 {
    errors.sort_by(f32::total_cmp);
    errors[errors.len() / 2]
}

/// Ceiling and lamp were not scanned. Where light from outside stands for them, most albedos are a fifth off and not as much
/// again as they are.
#[test]
fn a_lamp_that_the_mesh_lacks() {
    let (problem, materials) = room_without(&["ceiling", "lamp"]);
    let run = |outside_light: bool| {
        let settings = Settings {
            preset: Preset::Preview,
            outside_light,
            ..Settings::default()
        };
        scenes::solved(&problem, &settings)
    };
    let [with, without] = [true, false].map(run);
    let [with, without] = [with, without].map(|s| errors(&s.estimate, &materials));
    println!("errors with light from outside {with:?}, without {without:?}");
    // 0.178 and 1.000 are seen.
    let [with, without] = [with, without].map(median);
    assert!(with < 0.20 && without > 0.8, "{with} {without}");
}

/// Of a scan, light from a box around it is tried too: the lamp is near by, and the box tells its light better.
#[test]
fn a_lamp_that_a_scan_lacks_is_found_near_by() {
    let (mut problem, materials) = room_without(&["ceiling", "lamp"]);
    Arc::get_mut(&mut problem.scene).expect("one owner").scanned = true;
    let solution = scenes::solved(&problem, &scenes::with_fewer_paths());
    let outside = solution.estimate.outside.as_ref().expect("light");
    assert!(matches!(outside.surroundings, Surroundings::Box { .. }));
    let errors = errors(&solution.estimate, &materials);
    println!("errors {errors:?}");
    // 0.173 is seen.
    assert!(median(errors.clone()) < 0.2, "{errors:?}");
}

/// A block was not scanned: its blue lands on whatever lies behind it, elsewhere in each photograph. The floor that it stands on,
/// and whose spot below it no photograph shows, takes some of it; nothing else does.
#[test]
fn a_part_that_the_mesh_lacks() {
    let (problem, materials) = room_without(&["block"]);
    let solution = scenes::solved(&problem, &scenes::with_fewer_paths());
    for stage in &solution.progress.stages {
        println!("{}: {}", stage.name, stage.why);
    }
    let lamp = materials.iter().position(|m| m.emission != Vec3::ZERO);
    let found = errors(&solution.estimate, &materials);
    println!("errors {found:?}");
    for (k, object) in solution.estimate.objects.iter().enumerate() {
        assert_eq!(object.emission != Vec3::ZERO, Some(k) == lamp, "object {k}");
    }
    // The floor is 0.133 off, all else 0.023 at most.
    for (k, error) in found.iter().enumerate() {
        let allowed = if k == FLOOR { 0.18 } else { 0.03 };
        assert!(*error < allowed, "{k}: {found:?}");
    }
}
