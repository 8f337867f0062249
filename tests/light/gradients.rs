//! The gradient of the paper's squared loss against finite differences of an independent renderer.

use crate::scenes;
use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;
use relit::inverse::paths::derivative::{Gradient, differentiate};
use relit::inverse::paths::trace::Tracer;
use relit::inverse::settings::LightSampling;
use relit::inverse::unknowns::Unknowns;
use relit::math::rng::Stream;
use relit::math::stats::Moments;
use relit::scene::Scene;
use relit::transport::lit::LitScene;
use relit::transport::material::Material;
use relit::transport::path::{PathOptions, radiance};
use std::sync::Arc;

const SIZE: [u32; 2] = [4, 3];
const BOUNCES: u32 = 3;
/// Passes over all pixels, each of one path a set.
const PASSES: u64 = 4_000;
/// Half the distance of the finite differences; the loss is a polynomial, whose error is of the order of its square.
const H: f32 = 0.01;

/// A closed box with a lamp, where every surface also glows a little, so that all derivatives are at work.
fn world() -> (Arc<Scene>, Unknowns, LitScene) {
    let mut mesh = scenes::closed_box(1.0, DVec3::ZERO);
    scenes::lamp(&mut mesh, 0.4, DVec3::new(0.0, 0.8, -0.2));
    let view = (DVec3::new(0.3, -0.2, 0.8), DVec3::new(-0.1, 0.3, -0.9));
    let capture = scenes::capture(mesh, &[view], SIZE);
    let scene = Arc::new(Scene::new(&capture).expect("the box is sound"));
    let mut stream = Stream::new(21, 0, 0, 0);
    let mut color = || Vec3::from_array(std::array::from_fn(|_| stream.uniform()));
    let mut unknowns = Unknowns {
        albedo: (0..7).map(|_| color() * 0.6 + 0.2).collect(),
        emission: (0..7).map(|_| color() * 0.3 + 0.1).collect(),
    };
    unknowns.emission[6] = Vec3::new(6.0, 5.0, 4.0);
    let lit = LitScene::new(scene.clone(), materials(&unknowns), None);
    (scene, unknowns, lit)
}

fn materials(unknowns: &Unknowns) -> Vec<Material> {
    (unknowns.albedo.iter().zip(&unknowns.emission))
        .map(|(albedo, emission)| Material::diffuse(*albedo, *emission))
        .collect()
}

/// What a pixel's photograph shows: some colour that is not the render's.
fn target(pixel: u32) -> Vec3 {
    Vec3::new(0.4, 0.9, 0.5) + Vec3::new(0.1, -0.05, 0.02) * pixel as f32
}

fn corner(pixel: u32) -> Vec2 {
    Vec2::new((pixel % SIZE[0]) as f32, (pixel / SIZE[0]) as f32)
}

/// Mean over pixels of 2 (I_A − y) dI_B, and of 2 (I_A − y) dI_A, per parameter.
fn gradients(tracer: &Tracer, unknowns: &Unknowns, pass: u64) -> [Vec<DVec3>; 2] {
    let parameters = 2 * unknowns.surfaces();
    let mut sums = [vec![DVec3::ZERO; parameters], vec![DVec3::ZERO; parameters]];
    let pixels = SIZE[0] * SIZE[1];
    let mut sets = [Gradient::new(parameters), Gradient::new(parameters)];
    let (mut vertices, mut gathered) = (Vec::new(), Vec::new());
    for pixel in 0..pixels {
        let mut stream = Stream::new(22, 0, u64::from(pixel), pass);
        let colors: [Vec3; 2] = std::array::from_fn(|set| {
            sets[set].clear();
            vertices.clear();
            let camera = &tracer.scene.cameras[0];
            tracer.pixel_path(camera, corner(pixel), &mut stream, &mut vertices);
            differentiate(&vertices, unknowns, &[], &mut gathered, &mut sets[set])
        });
        let slope = (colors[0] - target(pixel)).as_dvec3() * (2.0 / f64::from(pixels));
        for (sum, set) in sums.iter_mut().zip([1, 0]) {
            for &touched in &sets[set].touched {
                sum[touched as usize] += slope * sets[set].values[touched as usize].as_dvec3();
            }
        }
    }
    sums
}

/// The squared loss, unbiased: the product of two independent renders' residuals. Light sampling stays that of `lit`,
/// so that the same random numbers give the same paths for all materials.
fn loss(lit: &LitScene, pass: u64) -> DVec3 {
    let options = PathOptions {
        max_bounces: BOUNCES,
        rr_depth: 100,
        ..Default::default()
    };
    let pixels = SIZE[0] * SIZE[1];
    let squares = (0..pixels).map(|pixel| {
        let [a, b] = [0, 1].map(|set| {
            let mut stream = Stream::new(23, set, u64::from(pixel), pass);
            let [dx, dy] = stream.uniform2();
            let ray = lit.scene.cameras[0].ray(corner(pixel) + Vec2::new(dx, dy));
            radiance(lit, &ray, &mut stream, &options).radiance - target(pixel)
        });
        a.as_dvec3() * b.as_dvec3()
    });
    squares.sum::<DVec3>() / f64::from(pixels)
}

/// The same loss with one parameter moved, in all channels.
fn moved(lit: &LitScene, unknowns: &Unknowns, parameter: usize, step: f32) -> LitScene {
    let mut unknowns = unknowns.clone();
    match parameter.checked_sub(unknowns.surfaces()) {
        None => unknowns.albedo[parameter] += step,
        Some(surface) => unknowns.emission[surface] += step,
    }
    LitScene {
        materials: materials(&unknowns),
        ..lit.clone()
    }
}

fn moments(passes: &[Vec<DVec3>], parameter: usize, channel: usize) -> Moments {
    let mut moments = Moments::default();
    passes
        .iter()
        .for_each(|pass| moments.push(pass[parameter][channel]));
    moments
}

/// 42 two-sided tests at 4.5 standard errors: together a false alarm in 3,500 seeds. The finite differences' own error
/// (their third-order term) is far below the noise.
#[test]
fn independent_samples_give_the_gradient_and_shared_samples_a_biased_one() {
    let (scene, unknowns, lit) = world();
    let expected = vec![0.5; unknowns.surfaces()];
    let tracer = Tracer {
        scene: &scene,
        lights: &lit.emitters,
        measured: None,
        texels: None,
        sky: None,
        outside: None,
        surface_of: &scene.object_of,
        expected_albedo: &expected,
        lobes: &[],
        patches: None,
        sampling: LightSampling::Mis,
        max_bounces: BOUNCES,
        seed: 0,
        stage: 0,
        round: 0,
    };
    let found: Vec<[Vec<DVec3>; 2]> = (0..PASSES)
        .into_par_iter()
        .map(|pass| gradients(&tracer, &unknowns, pass))
        .collect();
    let (independent, shared): (Vec<_>, Vec<_>) = found.into_iter().map(|[a, b]| (a, b)).unzip();

    let parameters = 2 * unknowns.surfaces();
    let sides: Vec<[LitScene; 2]> = (0..parameters)
        .map(|p| [H, -H].map(|step| moved(&lit, &unknowns, p, step)))
        .collect();
    let differences: Vec<Vec<DVec3>> = (0..PASSES / 2)
        .into_par_iter()
        .map(|pass| {
            let slope = |[up, down]: &[LitScene; 2]| {
                (loss(up, pass) - loss(down, pass)) / (2.0 * f64::from(H))
            };
            sides.iter().map(slope).collect()
        })
        .collect();

    let (mut biased, mut sizes) = (0, Vec::new());
    for parameter in 0..parameters {
        for channel in 0..3 {
            let gradient = moments(&independent, parameter, channel);
            let difference = moments(&differences, parameter, channel);
            let error = gradient.standard_error().hypot(difference.standard_error());
            let z = (gradient.mean - difference.mean) / error;
            println!(
                "parameter {parameter} channel {channel}: {:.5} against {:.5} ± {error:.5}, z {z:.2}",
                gradient.mean, difference.mean
            );
            assert!(
                z.abs() < 4.5,
                "parameter {parameter}, channel {channel}: z {z}"
            );
            sizes.push(gradient.mean.abs() / error);

            let gradient = moments(&shared, parameter, channel);
            let error = gradient.standard_error().hypot(difference.standard_error());
            biased += usize::from((gradient.mean - difference.mean) / error > 6.0);
        }
    }
    // The test must be able to see: most derivatives stand far above their noise, and the bias of shared samples shows.
    sizes.sort_by(f64::total_cmp);
    println!("signal to noise {sizes:.1?}; {biased} biased");
    assert!(sizes[sizes.len() / 2] > 10.0, "{sizes:?}");
    assert!(biased > 10, "only {biased} of 42 derivatives show the bias");
}
