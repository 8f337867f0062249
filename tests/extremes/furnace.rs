//! Closed furnaces from black to a reflectance of 0.9999.

use crate::{grey, preset, run, run_briefly, z};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use relit::inverse::estimate::{Estimate, ObjectEstimate};
use relit::inverse::loss::LossProbe;
use relit::inverse::settings::Preset;
use relit::math::rng::Stream;
use relit::math::stats::Moments;
use relit::math::warp;
use relit::scene::geometry::Ray;
use relit::transport::lit::LitScene;
use relit::transport::path::{PathOptions, radiance};

const ALBEDOS: [f32; 6] = [0.0, 0.5, 0.9, 0.99, 0.999, 0.9999];

/// Radiance is Le / (1 − ρ); 18 tests at four standard errors (6e-5 each). Sixteen batches of equal size, so that the
/// standard error itself is well known, and its square must shrink as paths are added: the variance is finite.
#[test]
fn radiance_in_a_closed_furnace_is_its_closed_form() {
    for albedo in ALBEDOS {
        let lit = LitScene::new(
            crate::scenes::scene_of(crate::scenes::closed_box(1.0, DVec3::ZERO)),
            vec![grey(albedo, 1.0); 6],
            None,
        );
        let truth = 1.0 / (1.0 - f64::from(albedo));
        for (emitters, bsdf) in [(true, true), (true, false), (false, true)] {
            let options = PathOptions {
                sample_emitters: emitters,
                sample_bsdf: bsdf,
                ..Default::default()
            };
            let samples: Vec<f64> = (0..400u64)
                .into_par_iter()
                .map(|index| {
                    let mut stream = Stream::new(61, 0, 0, index);
                    let ray = Ray::new(Vec3::ZERO, warp::uniform_sphere(stream.uniform2()));
                    let sample = radiance(&lit, &ray, &mut stream, &options);
                    assert!(!sample.rejected);
                    f64::from(sample.radiance.x)
                })
                .collect();
            let mut moments = Moments::default();
            samples.iter().for_each(|&s| moments.push(s));
            let z = z(&moments, truth);
            let spread = moments.variance().sqrt() / truth;
            println!(
                "albedo {albedo}, light sampling {emitters}, BSDF sampling {bsdf}: {:.4} against {truth:.4}, z {z:.2}, \
                 deviation of a path {spread:.2}",
                moments.mean
            );
            assert!(z.abs() < 4.0, "albedo {albedo}: z {z}");
            // A path that ends with the chance that it would have been absorbed has a geometric number of bounces.
            // Light sampling alone meets lamps from next to them, where the inverse square knows no bound.
            assert!(!bsdf || spread < 2.0, "albedo {albedo}: deviation {spread}");
        }
    }
}

/// Where every surface emits and reflects alike, light after k bounces is the rest of a geometric series, its fraction ρ^(k+1): within
/// 4 standard errors (6e-5 each) in nine tests.
#[test]
fn what_comes_after_some_bounces_is_the_rest_of_the_series() {
    for albedo in [0.3f32, 0.7, 0.9] {
        let capture = crate::scenes::capture(
            crate::scenes::closed_box(1.0, DVec3::ZERO),
            &crate::scenes::room_views(),
            [16, 12],
        );
        let materials = vec![grey(albedo, 1.0); 6];
        let problem = crate::scenes::photographed(&capture, &materials, 1, 0);
        let object = ObjectEstimate {
            albedo: Vec3::splat(albedo),
            emission: Vec3::ONE,
            ..Default::default()
        };
        let estimate = Estimate {
            objects: vec![object; 6],
            ..Default::default()
        };
        let probe = LossProbe::new(&problem, &preset(Preset::Balanced), 400, 16, 1000);
        for bounces in [0, 1, 5] {
            let rest = probe.beyond(&problem, &estimate, bounces).expect("light");
            let truth = f64::from(albedo).powi(bounces as i32 + 1);
            let z = (rest.fraction - truth) / rest.stderr;
            println!("albedo {albedo}, after {bounces}: {rest:?} against {truth:.4}, z {z:.2}");
            // Three channels, of which the largest share is told, are one here.
            assert!(z.abs() < 4.0, "albedo {albedo}, {bounces} bounces: z {z}");
            assert!(rest.stderr < 0.05, "{rest:?}");
        }
    }
}

/// What a solve says of a face.
fn print(chosen: Preset, albedo: f32, face: usize, o: &ObjectEstimate) {
    println!(
        "{chosen:?} albedo {albedo} face {face}: {} ± {}, emission {} ± {}, identifiable {} {}: {}",
        o.albedo.x,
        o.albedo_stderr.x,
        o.emission.x,
        o.emission_stderr.x,
        o.identifiable,
        o.albedo_identifiable,
        o.note
    );
}

/// Where walls both emit and reflect alike, photographs show one colour, which any pair of emission and albedo
/// explains: the solver must say so, or be right within 4.5 of its standard errors.
#[test]
fn a_furnace_seen_in_photographs_is_recovered_or_said_to_be_unknown() {
    for albedo in ALBEDOS {
        let capture = crate::scenes::capture(
            crate::scenes::closed_box(1.0, DVec3::ZERO),
            &crate::scenes::room_views(),
            [16, 12],
        );
        let level = 1.0 / (1.0 - albedo);
        let mut problem = crate::scenes::photographed(&capture, &vec![grey(0.0, 1.0); 6], 1, 0);
        for photograph in &mut problem.photographs {
            let pixels = vec![Vec3::splat(level); photograph.pixels.len()];
            *photograph = std::sync::Arc::new(crate::scenes::photograph([16, 12], pixels));
        }
        for chosen in [Preset::Preview, Preset::Balanced] {
            // The photographs are those of every albedo but for their level, and estimates scale with it to the bit (`units.rs`).
            if chosen == Preset::Balanced && albedo != 0.5 {
                continue;
            }
            let estimate = run_briefly(&problem, &preset(chosen)).estimate;
            for (k, o) in estimate.objects.iter().enumerate() {
                let error = (o.albedo - albedo).abs();
                let honest = error.cmple(o.albedo_stderr * 4.5).all();
                print(chosen, albedo, k, o);
                assert!(
                    !o.albedo_identifiable || honest,
                    "{chosen:?}, albedo {albedo}, face {k}: {o:?}"
                );
            }
        }
    }
}

/// A furnace with a lamp for its ceiling: albedos within 4.5 standard errors, or a thousandth, or said to be unknown; how
/// many are said to be known, of five walls and the lamp.
fn beside_a_lamp(albedo: f32, chosen: Preset) -> [usize; 2] {
    let mut materials = vec![grey(albedo, 0.0); 6];
    materials[3] = grey(0.0, 2.0);
    let capture = crate::scenes::capture(
        crate::scenes::closed_box(1.0, DVec3::ZERO),
        &crate::scenes::room_views(),
        [16, 12],
    );
    let problem = crate::scenes::photographed(&capture, &materials, 256, 63);
    let solution = run(&problem, &preset(chosen));
    let mut known = [0; 2];
    for (k, o) in solution.estimate.objects.iter().enumerate() {
        print(chosen, albedo, k, o);
        if k == 3 {
            known[1] += usize::from(o.identifiable);
            let found = (o.emission - 2.0).abs().max_element() < 0.02;
            assert!(
                found || !o.identifiable,
                "albedo {albedo}, {chosen:?}: {o:?}"
            );
            continue;
        }
        known[0] += usize::from(o.albedo_identifiable);
        let told = o.albedo_stderr.max_element() < 0.03;
        assert!(told || !o.albedo_identifiable, "{o:?}");
        let error = (o.albedo - albedo).abs();
        let allowed = (o.albedo_stderr * 4.5).max(Vec3::splat(1e-3));
        assert!(
            !o.albedo_identifiable || error.cmple(allowed).all(),
            "{chosen:?}, albedo {albedo}, face {k}: {o:?}"
        );
    }
    println!("{chosen:?} albedo {albedo}: {known:?} known");
    known
}

/// Where the lamp is found, all walls are known. `preview` finds it neither among black walls nor among those of 0.99, and says
/// of each surface that it is not known.
#[test]
fn albedos_are_recovered_within_their_errors_where_the_lamp_beside_them_is_found() {
    let previews = [0.0, 0.5, 0.9, 0.99].map(|albedo| beside_a_lamp(albedo, Preset::Preview));
    let balanced = [0.5, 0.99].map(|albedo| beside_a_lamp(albedo, Preset::Balanced));
    assert_eq!(previews, [[0, 0], [5, 1], [5, 1], [0, 0]]);
    assert_eq!(balanced, [[5, 1]; 2]);
}

/// Between white walls all radiance tends to the lamp's, and little tells which surface it is.
#[test]
fn albedos_of_white_walls_are_recovered_or_said_to_be_unknown_beside_a_lamp() {
    for (albedo, chosen) in [
        (0.999, Preset::Preview),
        (0.9999, Preset::Preview),
        (0.9999, Preset::Balanced),
    ] {
        beside_a_lamp(albedo, chosen);
    }
}
