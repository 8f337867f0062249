//! The path tracer against closed forms and against itself.

use glam::{DMat3, DVec3, Vec3};
use relit::capture::camera::{Intrinsics, Pose};
use relit::capture::mesh::Mesh;
use relit::capture::photograph::{Encoding, Photograph, PhotographSource};
use relit::capture::{Capture, Frame};
use relit::math::rng::Stream;
use relit::math::stats::Moments;
use relit::scene::Scene;
use relit::scene::geometry::Ray;
use relit::transport::lit::Lit;
use relit::transport::material::Material;
use relit::transport::path::{PathOptions, radiance};
use std::sync::Arc;

/// Adds a quad, counter-clockwise seen from its front.
fn quad(mesh: &mut Mesh, name: &str, corners: [DVec3; 4]) {
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(corners);
    mesh.triangles
        .extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    let object = mesh.objects.len() as u32;
    mesh.object_of.extend([object, object]);
    mesh.objects.push(name.to_owned());
}

/// A closed box of half size `half` about `center`, its six faces looking inwards.
fn room(half: f64, center: DVec3) -> Mesh {
    let mut mesh = Mesh::default();
    for (name, axis, sign) in [
        ("left", 0, -1.0),
        ("right", 0, 1.0),
        ("floor", 1, -1.0),
        ("ceiling", 1, 1.0),
        ("back", 2, -1.0),
        ("front", 2, 1.0),
    ] {
        let mut n = DVec3::ZERO;
        n[axis] = sign;
        let mut u = DVec3::ZERO;
        u[(axis + 1) % 3] = 1.0;
        let v = n.cross(u);
        // u × (n × u) = n for unit u ⟂ n, so the order that looks along −n is v before u.
        let at = |a: f64, b: f64| center + (n + v * a + u * b) * half;
        quad(
            &mut mesh,
            name,
            [at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)],
        );
    }
    mesh
}

fn scene_of(mesh: Mesh) -> Arc<Scene> {
    let intrinsics = Intrinsics {
        width: 4,
        height: 4,
        fx: 4.0,
        fy: 4.0,
        cx: 2.0,
        cy: 2.0,
        distortion: [0.0; 4],
    };
    let photograph = Photograph {
        width: 4,
        height: 4,
        pixels: vec![Vec3::ZERO; 16],
        usable: Vec::new(),
        encoding: Encoding::Linear,
        saturation: f32::INFINITY,
    };
    let capture = Capture {
        name: "test".into(),
        folder: None,
        mesh,
        frames: vec![Frame {
            intrinsics,
            pose: Pose {
                rotation: DMat3::IDENTITY,
                center: DVec3::ZERO,
            },
            exposure: None,
            photograph: PhotographSource::Memory(Arc::new(photograph)),
            depth: None,
        }],
        up: DVec3::Y,
        warnings: Vec::new(),
    };
    Arc::new(Scene::new(&capture).expect("the test scene is sound"))
}

fn mean_radiance(lit: &Lit, options: &PathOptions, seed: u64, paths: u64) -> [Moments; 3] {
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
            let mesh = room(half, center);
            let material = Material::diffuse(Vec3::splat(albedo), Vec3::new(1.0, 2.0, 1e-6));
            let lit = Lit::new(scene_of(mesh), vec![material; 6], None);
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
    let lit = Lit::new(
        scene_of(room(1.0, DVec3::ZERO)),
        vec![Material::diffuse(Vec3::splat(0.5), Vec3::ONE); 6],
        None,
    );
    for (bounces, truth) in [(0, 1.0), (1, 1.5), (2, 1.75), (3, 1.875)] {
        let options = PathOptions {
            max_bounces: bounces,
            sample_emitters: false,
            roulette_after: 100,
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
    let mut mesh = room(1.0, DVec3::ZERO);
    let y = 0.9;
    quad(
        &mut mesh,
        "lamp",
        [
            DVec3::new(-0.3, y, -0.3),
            DVec3::new(0.3, y, -0.3),
            DVec3::new(0.3, y, 0.3),
            DVec3::new(-0.3, y, 0.3),
        ],
    );
    let mut materials = vec![Material::diffuse(Vec3::new(0.7, 0.5, 0.2), Vec3::ZERO); 6];
    materials.push(Material::diffuse(
        Vec3::splat(0.3),
        Vec3::new(10.0, 8.0, 5.0),
    ));
    let lit = Lit::new(scene_of(mesh), materials, None);
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
