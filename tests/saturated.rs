//! Photographs that saturate: what they show of a lamp is a lower bound, and the lamp is found by the light that it sends.

mod scenes;

use glam::Vec3;
use relit::inverse::estimate::Estimate;
use relit::inverse::loss::LossProbe;
use relit::inverse::paper::descent::{Descent, Grain};
use relit::inverse::settings::{Preset, Settings};
use relit::inverse::solver::Problem;
use relit::transport::material::Material;
use scenes::albedo;
use std::sync::Arc;

const LAMP: usize = 6;
/// A third to a half of the lamp's radiance, and more than any wall sends.
const CLIPPED: f32 = 5.0;

/// The room in photographs that saturate at a value, and its materials.
fn clipped(at: f32) -> (Problem, Vec<Material>) {
    let (mesh, materials) = scenes::lamp_room();
    let capture = scenes::capture(mesh, &scenes::room_views(), [48, 36]);
    let mut problem = scenes::photographed(&capture, &materials, 192, 43);
    for photograph in &mut problem.photographs {
        let photograph = Arc::make_mut(photograph);
        photograph.saturation = Vec3::splat(at);
        for pixel in &mut photograph.pixels {
            *pixel = pixel.min(photograph.saturation);
        }
    }
    (problem, materials)
}

#[test]
fn a_saturated_lamp_is_found_by_its_light() {
    let (problem, materials) = clipped(CLIPPED);
    let saturated = |p: &Arc<_>| {
        (0..48 * 36).any(|i| relit::capture::photograph::Photograph::is_saturated(p, i))
    };
    assert!(problem.photographs.iter().any(saturated));
    for (preset, albedo_error, lamp_error) in
        [(Preset::Preview, 0.02, 0.1), (Preset::Balanced, 0.01, 0.03)]
    {
        let settings = Settings {
            preset,
            ..Settings::default()
        };
        let solution = scenes::solved(&problem, &settings);
        let objects = &solution.estimate.objects;
        for (k, (object, material)) in objects.iter().zip(&materials).enumerate() {
            if k == LAMP {
                let off = (object.emission / material.emission - Vec3::ONE).abs();
                assert!(off.max_element() < lamp_error, "{preset:?}: {object:?}");
            } else {
                let off = (object.albedo - albedo(material)).abs().element_sum() / 3.0;
                assert!(off < albedo_error, "{preset:?}: {k}: {object:?}");
                assert_eq!(object.emission, Vec3::ZERO, "{preset:?}: {k}");
            }
        }
    }
}

/// Every pixel is a lower bound, far below what the true room shows: nothing is wrong with it.
#[test]
fn what_exceeds_lower_bounds_has_no_loss_and_no_slope() {
    let (problem, materials) = clipped(1e-4);
    let settings = Settings {
        emission_weight: 0.0,
        // So many that none of the pixels stays dark by chance.
        samples: 256,
        ..Settings::default()
    };
    let mut descent = Descent::new(&problem, Grain::Objects);
    for (k, material) in materials.iter().enumerate() {
        descent.unknowns.albedo[k] = albedo(material);
        descent.unknowns.emission[k] = material.emission;
        descent.lights[k] = material.emission;
    }
    let before = descent.unknowns.clone();
    for _ in 0..4 {
        descent.step(&problem, &settings, 3);
    }
    assert_eq!(descent.unknowns, before);

    let mut estimate = Estimate::default();
    estimate.objects = (materials.iter())
        .map(|material| relit::inverse::estimate::ObjectEstimate {
            albedo: Vec3::splat(0.5),
            emission: material.emission,
            ..Default::default()
        })
        .collect();
    let losses = LossProbe::new(&problem, &settings, 100, 4, 3).measure(&problem, &estimate);
    let train = losses.train.expect("pixels are in the fit");
    assert!(train < 2e-5, "{train}");
}
