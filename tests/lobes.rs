//! Rough specular lobes, found from photographs rendered in memory: on what has one, and on nothing else.

mod scenes;

use glam::{DVec3, Vec3};
use relit::inverse::estimate::relative_to_albedo;
use relit::inverse::settings::Settings;
use relit::inverse::solver::{Problem, Solution};
use relit::transport::material::{Albedo, Lobe, Material};
use std::sync::LazyLock;

/// The rough objects, after the walls, the lamp and a diffuse block: name, albedo, roughness, specular.
const ROUGH: [(&str, [f32; 3], f32, f32); 3] = [
    ("glazed", [0.50, 0.22, 0.12], 0.12, 0.25),
    ("waxed", [0.20, 0.32, 0.50], 0.30, 0.10),
    ("brushed", [0.30, 0.26, 0.20], 0.50, 0.60),
];
const FIRST: usize = 8;

/// The lamp room with three more blocks, photographed from twelve sides.
fn room(lobes: bool) -> (Problem, Vec<Material>) {
    let (mut mesh, mut materials) = scenes::lamp_room();
    let places = [
        ([0.35, -0.79, 0.30], [0.30, 0.20, 0.30]),
        ([0.55, -0.64, -0.55], [0.25, 0.35, 0.20]),
        ([-0.55, -0.74, 0.50], [0.25, 0.25, 0.25]),
    ];
    for ((name, albedo, roughness, specular), (center, half)) in ROUGH.into_iter().zip(places) {
        let (center, half) = (DVec3::from_array(center), DVec3::from_array(half));
        scenes::block(&mut mesh, name, half, center);
        let mut material = Material::diffuse(albedo.into(), Vec3::ZERO);
        material.lobe = lobes.then_some(Lobe {
            roughness,
            specular: Vec3::splat(specular),
        });
        materials.push(material);
    }
    let closer = [
        ([0.8, 0.2, 0.9], [0.0, -0.7, -0.2]),
        ([-0.8, 0.3, 0.9], [0.2, -0.7, -0.2]),
        ([0.9, 0.3, -0.9], [-0.1, -0.7, 0.3]),
        ([-0.9, 0.2, -0.8], [0.3, -0.7, 0.3]),
        ([0.1, 0.5, -0.9], [0.0, -0.9, 0.3]),
        ([-0.9, 0.6, 0.1], [0.4, -0.8, 0.0]),
    ]
    .map(|(center, target)| (DVec3::from_array(center), DVec3::from_array(target)));
    let views: Vec<_> = closer.into_iter().chain(scenes::room_views()).collect();
    let capture = scenes::capture(mesh, &views, [64, 48]);
    let problem = scenes::photographed(&capture, &materials, 160, 43);
    (problem, materials)
}

fn solved(problem: &Problem) -> Solution {
    let settings = Settings {
        textures: false,
        ..Settings::default()
    };
    scenes::solved(problem, &settings)
}

static ROUGH_ROOM: LazyLock<(Solution, Vec<Material>)> = LazyLock::new(|| {
    let (problem, materials) = room(true);
    (solved(&problem), materials)
});

fn told(solution: &Solution) {
    for stage in &solution.progress.stages {
        println!("{}: {} ({:.1} s)", stage.name, stage.why, stage.seconds);
    }
}

#[test]
fn lobes_are_found_where_they_are_and_nowhere_else() {
    let (solution, _) = &*ROUGH_ROOM;
    told(solution);
    for (k, object) in solution.estimate.objects.iter().enumerate() {
        let Some((_, _, roughness, _)) = k.checked_sub(FIRST).map(|i| ROUGH[i]) else {
            assert_eq!(object.roughness, None, "object {k}");
            continue;
        };
        let found = object.roughness.expect("it has a lobe");
        assert!((found - roughness).abs() < 0.05, "{found} for {roughness}");
    }
}

#[test]
fn albedos_are_those_of_the_base() {
    let (solution, materials) = &*ROUGH_ROOM;
    for (k, (object, material)) in solution.estimate.objects.iter().zip(materials).enumerate() {
        let Albedo::Constant(albedo) = material.albedo else {
            continue;
        };
        let off = relative_to_albedo(object.albedo - albedo, albedo);
        println!("object {k}: {off:.4} off, {:?}", object.specular);
        assert!(off < 0.03 || albedo == Vec3::ZERO, "object {k}: {off}");
    }
}

#[test]
fn the_diffuse_twin_keeps_no_lobe() {
    let solution = solved(&room(false).0);
    told(&solution);
    assert!(
        solution
            .estimate
            .objects
            .iter()
            .all(|o| o.roughness.is_none())
    );
    let stage = solution.progress.stages.iter().find(|s| s.name == "lobes");
    assert!(!stage.expect("it was looked for").kept);
}
