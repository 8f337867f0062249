//! Photographs that do not show what the others show.

use crate::scenes;
use glam::DVec3;
use relit::calibrate::problem::Problem;
use relit::capture::photograph::Photograph;
use relit::inverse::settings::{Preset, Settings};
use relit::inverse::solver::Solution;
use relit::scene::Scene;
use relit::transport::material::Material;
use std::sync::{Arc, LazyLock};

const WRONG: usize = 2;

/// The lamp room in nine photographs; in the second problem the pose of one says that it looks elsewhere.
static ROOM: LazyLock<([Problem; 2], Vec<Material>)> = LazyLock::new(|| {
    let (mesh, materials) = scenes::lamp_room();
    let more = [
        ([0.0, 0.3, 0.9], [0.0, -0.4, -1.0]),
        ([-0.9, 0.4, 0.0], [0.8, -0.6, 0.1]),
        ([0.2, 0.0, -0.9], [-0.2, -0.3, 1.0]),
    ]
    .map(|(center, target)| (DVec3::from_array(center), DVec3::from_array(target)));
    let mut views: Vec<_> = scenes::room_views().into_iter().chain(more).collect();
    let capture = scenes::capture(mesh.clone(), &views, [64, 48]);
    let right = scenes::photographed(&capture, &materials, 128, 61);

    views[WRONG].1 = DVec3::new(-0.9, -0.3, -0.6);
    let turned = scenes::capture(mesh, &views, [64, 48]);
    let wrong = Problem {
        scene: Arc::new(Scene::new(&turned).expect("the test scene is sound")),
        photographs: right.photographs.clone(),
    };
    ([right, wrong], materials)
});

fn solved(problem: &Problem, leave_out: bool) -> Solution {
    let settings = Settings {
        preset: Preset::Preview,
        leave_out,
        ..Settings::default()
    };
    scenes::solved(problem, &settings)
}

/// Mean absolute error of albedo over all that reflects.
fn error(solution: &Solution) -> f32 {
    let materials = ROOM.1.iter().zip(&solution.estimate.objects);
    let errors: Vec<f32> = materials
        .filter(|(material, _)| material.emission.max_element() == 0.0)
        .map(|(material, object)| {
            let off = object.albedo - scenes::albedo(material);
            off.abs().element_sum() / 3.0
        })
        .collect();
    errors.iter().sum::<f32>() / errors.len() as f32
}

#[test]
fn a_photograph_whose_pose_is_wrong_is_left_out_and_said() {
    let [right, wrong] = &ROOM.0;
    assert!(solved(right, true).progress.warnings.is_empty());
    let mut others = right.clone();
    let unusable = &mut others.photographs[WRONG];
    *unusable = Arc::new(Photograph {
        usable: vec![false; unusable.pixels.len()],
        ..Photograph::clone(unusable)
    });
    let [without, left_out, kept] =
        [(&others, false), (wrong, true), (wrong, false)].map(|(p, l)| solved(p, l));
    println!("{:?}", left_out.progress.warnings);
    let [warning] = &left_out.progress.warnings[..] else {
        panic!("one photograph is left out");
    };
    assert!(warning.contains(&format!("frame {WRONG} ")));
    let [without, left_out, kept] = [without, left_out, kept].map(|s| error(&s));
    println!("errors of albedo: without it {without}, with it left out {left_out}, with it {kept}");
    assert!(left_out < 1.05 * without && kept > 5.0 * left_out);
}
