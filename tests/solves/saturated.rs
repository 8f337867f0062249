//! Photographs that saturate: what they show of a lamp is a lower bound, and the lamp is found by the light that it sends.

use crate::scenes;
use crate::scenes::albedo;
use glam::Vec3;
use relit::calibrate::problem::Problem;
use relit::capture::photograph::{Photograph, PhotographSource};
use relit::capture::working::load_working;
use relit::inverse::estimate::Estimate;
use relit::inverse::loss::LossProbe;
use relit::inverse::paper::descent::Descent;
use relit::inverse::settings::{Preset, Settings};
use relit::transport::material::Material;
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
        scenes::clip(Arc::make_mut(photograph), at);
    }
    (problem, materials)
}

#[test]
fn a_saturated_lamp_is_found_by_its_light() {
    let (problem, materials) = clipped(CLIPPED);
    let saturated = |p: &Arc<Photograph>| (0..48 * 36).any(|i| p.is_saturated(i));
    assert!(problem.photographs.iter().any(saturated));
    for (preset, albedo_error, lamp_error) in [
        (Preset::Preview, 0.015, 0.03),
        (Preset::Balanced, 0.002, 0.01),
    ] {
        let settings = Settings {
            preset,
            ..Settings::default()
        };
        let solution = scenes::solved(&problem, &settings);
        let objects = &solution.estimate.objects;
        for (k, (object, material)) in objects.iter().zip(&materials).enumerate() {
            if k == LAMP {
                let off = (object.emission / material.emission - Vec3::ONE).abs();
                println!("{preset:?}: lamp {off} off");
                assert!(off.max_element() < lamp_error, "{preset:?}: {object:?}");
            } else {
                let off = (object.albedo - albedo(material)).abs().element_sum() / 3.0;
                println!("{preset:?}: {k} {off} off");
                assert!(off < albedo_error, "{preset:?}: {k}: {object:?}");
                assert_eq!(object.emission, Vec3::ZERO, "{preset:?}: {k}");
            }
        }
    }
}

/// Each pixel mixed with those around it, as by a lens slightly out of focus, a resampling, or JPEG.
fn blurred(photograph: &Photograph) -> Vec<Vec3> {
    let [width, height] = [photograph.width, photograph.height].map(|size| size as i32);
    let mixed = |pixel: i32| {
        let (x, y) = (pixel % width, pixel / width);
        let around = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
        let weighed = around.map(|(dx, dy): (i32, i32)| {
            let (x, y) = ((x + dx).clamp(0, width - 1), (y + dy).clamp(0, height - 1));
            let weight = f32::from((2 - dx.unsigned_abs() as u8) * (2 - dy.unsigned_abs() as u8));
            photograph.pixels[(y * width + x) as usize] * weight / 16.0
        });
        weighed.sum()
    };
    (0..width * height).map(mixed).collect()
}

/// Around a lamp that is clipped before it is mixed with the wall every pixel tells of less light than there is.
#[test]
fn a_lamp_whose_clipped_light_is_blurred_is_found_too() {
    let (mesh, materials) = scenes::lamp_room();
    let mut capture = scenes::capture(mesh, &scenes::room_views(), [96, 72]);
    let mut problem = scenes::photographed(&capture, &materials, 192, 44);
    for (frame, photograph) in capture.frames.iter_mut().zip(&mut problem.photographs) {
        let photograph = Arc::make_mut(photograph);
        scenes::clip(photograph, CLIPPED);
        photograph.pixels = blurred(photograph);
        frame.photograph = PhotographSource::Memory(Arc::new(photograph.clone()));
    }
    let read = load_working(&capture, u64::MAX).expect("all in memory");
    problem.photographs = read.photographs;
    let settings = Settings {
        preset: Preset::Preview,
        ..Settings::default()
    };
    let solution = scenes::solved(&problem, &settings);
    let objects = &solution.estimate.objects;
    let off = (objects[LAMP].emission / materials[LAMP].emission - Vec3::ONE).abs();
    println!("lamp {off} off");
    assert!(off.max_element() < 0.1, "{:?}", objects[LAMP]);
    for (k, material) in materials.iter().enumerate().filter(|(k, _)| *k != LAMP) {
        let off = (objects[k].albedo - albedo(material)).abs().element_sum() / 3.0;
        println!("{k} {off} off");
        assert!(off < 0.03, "{k}: {:?}", objects[k]);
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
    let mut descent = Descent::new(&problem);
    for (k, material) in materials.iter().enumerate() {
        descent.albedo[k] = albedo(material);
        descent.emission[k] = material.emission;
    }
    let before = descent.clone();
    for _ in 0..4 {
        descent.step(&problem, &settings, 3);
    }
    assert_eq!(descent.albedo, before.albedo);
    assert_eq!(descent.emission, before.emission);

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
    println!("loss {train}");
    assert!(train < 2e-5, "{train}");
}
