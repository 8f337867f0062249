//! The path tracer against closed forms and against itself.

use crate::scenes::{closed_box, lamp, scene_of};
use glam::{DVec3, Vec3};
use relit::math::rng::Stream;
use relit::math::stats::Moments;
use relit::scene::geometry::Ray;
use relit::transport::lit::LitScene;
use relit::transport::material::Material;
use relit::transport::path::{PathOptions, radiance};

fn mean_radiance(lit: &LitScene, options: &PathOptions, seed: u64, paths: u64) -> [Moments; 3] {
    let mut moments = [Moments::default(); 3];
    for index in 0..paths {
        let mut stream = Stream::new(seed, 0, 0, index);
        let [x, y] = stream.uniform2();
        let direction = Vec3::new(x - 0.5, y - 0.5, -1.0);
        let sample = radiance(
            lit,
            &Ray::new(Vec3::ZERO, direction.normalize_or_zero()),
            &mut stream,
            options,
        );
        assert!(!sample.rejected);
        for (m, v) in moments.iter_mut().zip(sample.radiance.to_array()) {
            m.push(f64::from(v));
        }
    }
    moments
}

/// Inside a closed box that emits Le everywhere and reflects ρ, radiance is Le/(1 − ρ). Significance 6e-5 (4 σ).
#[test]
fn closed_furnace_has_its_closed_form_radiance_at_any_size_and_place() {
    for (half, center) in [
        (1.0, DVec3::ZERO),
        (1e-4, DVec3::ZERO),
        (1e5, DVec3::ZERO),
        (1.0, DVec3::splat(1e5)),
    ] {
        for albedo in [0.0, 0.5, 0.9, 0.99] {
            let mesh = closed_box(half, center);
            let material = Material::diffuse(Vec3::splat(albedo), Vec3::new(1.0, 2.0, 1e-6));
            let lit = LitScene::new(scene_of(mesh), vec![material; 6], None);
            for (emitters, bsdf) in [(true, true), (true, false), (false, true)] {
                let options = PathOptions {
                    sample_emitters: emitters,
                    sample_bsdf: bsdf,
                    ..Default::default()
                };
                let moments = mean_radiance(&lit, &options, 1, 4_000);
                for (m, le) in moments.iter().zip([1.0, 2.0, 1e-6]) {
                    let truth = le / (1.0 - f64::from(albedo));
                    let z = (m.mean - truth) / m.standard_error().max(1e-6 * truth);
                    assert!(
                        z.abs() < 4.0,
                        "albedo {albedo}, size {half}, {emitters} {bsdf}: {} against {truth}, z {z}",
                        m.mean
                    );
                }
            }
        }
    }
}

/// Truncated furnace: k bounces give Le (1 + ρ + … + ρᵏ), exactly, since every path sees the same.
#[test]
fn a_truncated_path_holds_exactly_its_bounces() {
    let lit = LitScene::new(
        scene_of(closed_box(1.0, DVec3::ZERO)),
        vec![Material::diffuse(Vec3::splat(0.5), Vec3::ONE); 6],
        None,
    );
    for (bounces, truth) in [(0, 1.0), (1, 1.5), (2, 1.75), (3, 1.875)] {
        let options = PathOptions {
            max_bounces: bounces,
            sample_emitters: false,
            rr_depth: 100,
            ..Default::default()
        };
        let [m, ..] = mean_radiance(&lit, &options, 2, 100);
        assert!((m.mean - truth).abs() < 1e-5, "{bounces}: {}", m.mean);
        let options = PathOptions {
            sample_emitters: true,
            ..options
        };
        let [m, ..] = mean_radiance(&lit, &options, 2, 20_000);
        assert!(
            ((m.mean - truth) / m.standard_error().max(1e-6)).abs() < 4.0,
            "{bounces}: {}",
            m.mean
        );
    }
}

/// A lamp on the ceiling: light sampling alone, BSDF sampling alone and MIS have equal means. Significance 6e-5 a pair.
#[test]
fn the_three_ways_of_finding_light_agree() {
    let mut mesh = closed_box(1.0, DVec3::ZERO);
    lamp(&mut mesh, 0.3, DVec3::new(0.0, 0.9, 0.0));
    let mut materials = vec![Material::diffuse(Vec3::new(0.7, 0.5, 0.2), Vec3::ZERO); 6];
    materials.push(Material::diffuse(
        Vec3::splat(0.3),
        Vec3::new(10.0, 8.0, 5.0),
    ));
    let lit = LitScene::new(scene_of(mesh), materials, None);
    let options = |sample_emitters, sample_bsdf| PathOptions {
        sample_emitters,
        sample_bsdf,
        ..Default::default()
    };
    let mis = mean_radiance(&lit, &options(true, true), 3, 60_000);
    let light = mean_radiance(&lit, &options(true, false), 4, 60_000);
    let bsdf = mean_radiance(&lit, &options(false, true), 5, 60_000);
    for (a, b) in [(&mis, &light), (&mis, &bsdf)] {
        for channel in 0..3 {
            let error = a[channel]
                .standard_error()
                .hypot(b[channel].standard_error());
            let z = (a[channel].mean - b[channel].mean) / error;
            assert!(
                z.abs() < 4.0,
                "channel {channel}: {} against {}, z {z}",
                a[channel].mean,
                b[channel].mean
            );
        }
    }
    assert!(
        mis[0].standard_error() < 0.5 * bsdf[0].standard_error(),
        "MIS should be the less noisy one"
    );
}
