//! Units of light: nothing in the program may know what "bright" is.
//!
//! Powers of two scale f32 without rounding, so that the same numbers must come out to the bit; a threshold with a unit
//! anywhere in light transport or in the solver would change them.

use crate::{ROOM, SIZE, preset, run, scenes};
use glam::Vec3;
use relit::calibrate::problem::Problem;
use relit::inverse::settings::Preset;
use relit::math::rng::Stream;
use relit::scene::geometry::Ray;
use relit::transport::lit::LitScene;
use relit::transport::material::Material;
use relit::transport::path::{PathOptions, radiance};
use std::sync::Arc;

/// 2^±20 is about 1e±6, 2^±40 about 1e±12.
const SCALES: [f32; 4] = [
    1.0 / 1_099_511_627_776.0,
    1.0 / 1_048_576.0,
    1_048_576.0,
    1_099_511_627_776.0,
];

fn scaled(problem: &Problem, scale: f32) -> Problem {
    let photographs = problem.photographs.iter().map(|photograph| {
        let pixels = photograph.pixels.iter().map(|&p| p * scale).collect();
        Arc::new(scenes::photograph(SIZE, pixels))
    });
    Problem {
        scene: problem.scene.clone(),
        photographs: photographs.collect(),
    }
}

#[test]
fn estimates_scale_with_the_unit_of_light_to_the_bit() {
    for chosen in [Preset::Preview, Preset::Balanced] {
        let wanted = run(&ROOM.0, &preset(chosen));
        for scale in SCALES {
            let found = run(&scaled(&ROOM.0, scale), &preset(chosen));
            assert_eq!(found.termination, wanted.termination);
            assert_eq!(found.progress.iterations, wanted.progress.iterations);
            assert_eq!(found.progress.rays, wanted.progress.rays);
            for (k, (a, b)) in (found.estimate.objects.iter())
                .zip(&wanted.estimate.objects)
                .enumerate()
            {
                let what = format!("{chosen:?}, light × {scale:e}, object {k}");
                assert_eq!(a.albedo, b.albedo, "{what}");
                assert_eq!(a.albedo_stderr, b.albedo_stderr, "{what}");
                assert_eq!(a.emission, b.emission * scale, "{what}");
                assert_eq!(a.emission_stderr, b.emission_stderr * scale, "{what}");
                assert_eq!(a.identifiable, b.identifiable, "{what}");
                assert_eq!(a.albedo_identifiable, b.albedo_identifiable, "{what}");
            }
        }
    }
}

/// Decimal factors round, so that estimates may differ by rounding, far below their standard errors.
#[test]
fn estimates_scale_with_decimal_factors_within_rounding() {
    let wanted = run(&ROOM.0, &preset(Preset::Preview)).estimate;
    for scale in [1e-12, 1e-6, 1e6, 1e12] {
        let found = run(&scaled(&ROOM.0, scale), &preset(Preset::Preview)).estimate;
        for (k, (a, b)) in found.objects.iter().zip(&wanted.objects).enumerate() {
            let what = format!("light × {scale:e}, object {k}: {a:?} against {b:?}");
            assert!(
                (a.albedo - b.albedo).abs().max_element()
                    < 1e-3 * b.albedo_stderr.max_element().max(1e-3),
                "{what}"
            );
            assert!(
                (a.emission / scale - b.emission).length() <= 1e-4 * b.emission.length(),
                "{what}"
            );
        }
    }
}

#[test]
fn rendered_radiance_scales_with_emission_to_the_bit() {
    let (problem, materials) = &*ROOM;
    let lit = |scale: f32| {
        let materials = materials.iter().map(|m| Material {
            emission: m.emission * scale,
            ..m.clone()
        });
        LitScene::new(problem.scene.clone(), materials.collect(), None)
    };
    let trace = |lit: &LitScene, index: u64| {
        let mut stream = Stream::new(71, 0, 0, index);
        let camera = &problem.scene.cameras[(index % 6) as usize];
        let [x, y] = stream.uniform2();
        let ray = camera.ray(glam::Vec2::new(x * SIZE[0] as f32, y * SIZE[1] as f32));
        let sample = radiance(lit, &ray, &mut stream, &PathOptions::default());
        assert!(!sample.rejected);
        sample.radiance
    };
    let unit = lit(1.0);
    for scale in SCALES {
        let other = lit(scale);
        let mut lit_paths = 0;
        for index in 0..2_000 {
            let wanted = trace(&unit, index) * scale;
            assert_eq!(trace(&other, index), wanted, "light × {scale:e}");
            lit_paths += u32::from(wanted != Vec3::ZERO);
        }
        assert!(lit_paths > 1_000);
    }
    // Beyond any light that there is, paths still carry numbers.
    for scale in [1e-30, 1e30] {
        let other = lit(scale);
        for index in 0..500 {
            let ray = Ray::new(Vec3::ZERO, Vec3::new(0.1, 0.2, 1.0).normalize_or_zero());
            let mut stream = Stream::new(72, 0, 0, index);
            let sample = radiance(&other, &ray, &mut stream, &PathOptions::default());
            assert!(!sample.rejected && sample.radiance.is_finite());
        }
    }
}

/// A photograph's values are radiance times exposure.
#[test]
fn exposure_divides_out_to_the_bit() {
    use relit::capture::photograph::PhotographSource;
    use relit::capture::read::{ReadOptions, read};
    use relit::export::exr::{Precision, write_rgb};
    use relit::math::picture::Picture;
    let pixels: Vec<Vec3> = (0..8)
        .map(|i| Vec3::new(0.3, 0.7, 1.1) * (i + 1) as f32)
        .collect();
    for exposure in [1.0f32, 1.0 / 1_048_576.0, 1_048_576.0] {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let write = |name: &str, bytes: &[u8]| {
            std::fs::write(folder.path().join(name), bytes).expect("writes");
        };
        write(
            "mesh.obj",
            b"o t\nv -1 -1 -2\nv 1 -1 -2\nv 0 1 -2\nf 1 2 3\n",
        );
        let picture = Picture {
            width: 4,
            height: 2,
            pixels: pixels.iter().map(|&p| p * exposure).collect(),
        };
        write_rgb(&folder.path().join("a.exr"), &picture, Precision::Float).expect("writes");
        let transforms = serde_json::json!({
            "camera_model": "PINHOLE", "w": 4, "h": 2, "fl_x": 3, "fl_y": 3, "cx": 2, "cy": 1,
            "frames": [{"file_path": "a.exr", "exposure": exposure,
                "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}],
        });
        write("transforms.json", transforms.to_string().as_bytes());
        let capture = read(folder.path(), &ReadOptions::default()).expect("reads");
        let frame = &capture.frames[0];
        assert!(!matches!(frame.photograph, PhotographSource::Memory(_)));
        assert_eq!(
            frame.load().expect("loads").pixels,
            pixels,
            "exposure {exposure}"
        );
    }
}
