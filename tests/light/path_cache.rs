//! Cached paths, evaluated for given unknowns, against the path tracer with those materials.

use crate::scenes;
use glam::{BVec3, DVec3, Vec2, Vec3};
use rayon::prelude::*;
use relit::calibrate::gbuffer::GBuffer;
use relit::calibrate::held_out::HoldOut;
use relit::calibrate::measured_radiance::MeasuredRadiance;
use relit::calibrate::problem::Problem;
use relit::inverse::paths::PathCache;
use relit::inverse::paths::clusters::Cluster;
use relit::inverse::paths::lamp_patches::LampPatches;
use relit::inverse::paths::trace::Tracer;
use relit::inverse::roles::Role;
use relit::inverse::settings::{LightSampling, Settings};
use relit::inverse::unknowns::Unknowns;
use relit::math::rng::Stream;
use relit::math::stats::Moments;
use relit::scene::Scene;
use relit::transport::emitters::Emitters;
use relit::transport::lit::LitScene;
use relit::transport::material::{Lobe, Material};
use relit::transport::path::{PathOptions, radiance};
use std::sync::Arc;

const SIZE: [u32; 2] = [6, 4];
/// The room's lamp.
const LAMP: usize = 6;
/// Rounds of independent paths.
const ROUNDS: u32 = 1_500;
/// Paths a pixel of the renderings.
const SAMPLES: u64 = 6_000;

fn room() -> Arc<Scene> {
    let (mesh, _) = scenes::lamp_room();
    let capture = scenes::capture(mesh, &scenes::room_views()[..1], SIZE);
    Arc::new(Scene::new(&capture).expect("the room is sound"))
}

/// Random values, some emissions zero: the albedos expected when the paths were traced are none of them.
fn unknowns(surfaces: usize, key: u64) -> Unknowns {
    let mut stream = Stream::new(31, 0, 0, key);
    let mut color = || Vec3::from_array(std::array::from_fn(|_| stream.uniform()));
    let mut unknowns = Unknowns {
        albedo: (0..surfaces).map(|_| color() * 0.9).collect(),
        emission: (0..surfaces).map(|k| color() * (k % 3) as f32).collect(),
    };
    unknowns.emission[6] = color() * 10.0;
    unknowns
}

/// Lobes on the left wall and the ceiling, which emit nothing in [`unknowns`].
fn lobes(surfaces: usize) -> Vec<Option<Lobe>> {
    let lobe = |roughness: f32, specular: f32| Lobe {
        roughness,
        specular: Vec3::splat(specular),
    };
    let mut lobes = vec![None; surfaces];
    lobes[0] = Some(lobe(0.3, 0.2));
    lobes[3] = Some(lobe(0.6, 0.5));
    lobes
}

fn materials(unknowns: &Unknowns, lobes: &[Option<Lobe>]) -> Vec<Material> {
    (unknowns.albedo.iter().zip(&unknowns.emission).enumerate())
        .map(|(k, (albedo, emission))| Material {
            lobe: lobes.get(k).copied().flatten(),
            ..Material::diffuse(*albedo, *emission)
        })
        .collect()
}

/// Photograph minus model for each cluster, from set A and from set B.
fn residuals(cache: &PathCache, unknowns: &Unknowns) -> Vec<[DVec3; 2]> {
    let held = vec![usize::MAX; 2 * unknowns.surfaces()];
    let linearised = cache.linearise(unknowns, &held, &[]);
    linearised.into_iter().map(|l| l.residuals).collect()
}

/// The rows of the picture, each a cluster whose photograph is black: its residual is minus the cached radiance.
fn rows() -> Vec<Cluster> {
    let [width, height] = SIZE;
    let row = |y: u32| Cluster {
        frame: 0,
        object: 0,
        pixels: (y * width..(y + 1) * width).collect(),
        paths: 2,
        measured: Vec3::ZERO,
        censored: BVec3::FALSE,
        level: Some(Vec3::ZERO),
        dark: Vec3::ONE,
    };
    (0..height).map(row).collect()
}

/// Rounds of independent paths; light samples go mostly to the lamp and a little everywhere.
fn rounds(scene: &Scene, sampling: LightSampling, lobes: &[Option<Lobe>]) -> Vec<PathCache> {
    rounds_with(scene, sampling, lobes, None)
}

fn rounds_with(
    scene: &Scene,
    sampling: LightSampling,
    lobes: &[Option<Lobe>],
    patches: Option<&LampPatches>,
) -> Vec<PathCache> {
    let weights = [0.05, 0.05, 0.05, 0.05, 0.05, 0.05, 1.0, 0.05];
    let lights = Emitters::new(scene, &weights);
    let expected = vec![0.6; scene.objects.len()];
    let tracer = |round: u32| Tracer {
        scene,
        lights: &lights,
        measured: None,
        texels: None,
        sky: None,
        outside: None,
        surface_of: &scene.object_of,
        expected_albedo: &expected,
        lobes,
        patches,
        sampling,
        max_bounces: 1000,
        seed: sampling as u64,
        stage: 0,
        round,
    };
    let clusters = rows();
    (0..ROUNDS)
        .into_par_iter()
        .map(|round| tracer(round).trace(&clusters))
        .collect()
}

/// Mean radiance of each row in each channel, over rounds and both sets.
fn cached(rounds: &[PathCache], unknowns: &Unknowns) -> Vec<[Moments; 3]> {
    let mut moments = vec![[Moments::default(); 3]; SIZE[1] as usize];
    for cache in rounds {
        for (row, sets) in moments.iter_mut().zip(residuals(cache, unknowns)) {
            for (channel, row) in row.iter_mut().enumerate() {
                sets.iter().for_each(|set| row.push(-set[channel]));
            }
        }
    }
    moments
}

fn rendered(scene: &Arc<Scene>, unknowns: &Unknowns, lobes: &[Option<Lobe>]) -> Vec<[Moments; 3]> {
    let lit = LitScene::new(scene.clone(), materials(unknowns, lobes), None);
    let row = |y: u32| {
        let mut moments = [Moments::default(); 3];
        for sample in 0..SAMPLES {
            let mut sum = DVec3::ZERO;
            for x in 0..SIZE[0] {
                let mut stream = Stream::new(32, u64::from(y), u64::from(x), sample);
                let [dx, dy] = stream.uniform2();
                let ray = scene.cameras[0].ray(Vec2::new(x as f32 + dx, y as f32 + dy));
                let path = radiance(&lit, &ray, &mut stream, &PathOptions::default());
                sum += path.radiance.as_dvec3();
            }
            for (channel, m) in moments.iter_mut().enumerate() {
                m.push(sum[channel] / f64::from(SIZE[0]));
            }
        }
        moments
    };
    (0..SIZE[1]).into_par_iter().map(row).collect()
}

/// Largest difference of cached to rendered radiance over rows and channels, in standard errors.
fn worst(rounds: &[PathCache], unknowns: &Unknowns, truth: &[[Moments; 3]]) -> f64 {
    let found = cached(rounds, unknowns);
    let pairs = found.iter().flatten().zip(truth.iter().flatten());
    let z = pairs.map(|(found, truth)| {
        let error = found.standard_error().hypot(truth.standard_error());
        (found.mean - truth.mean).abs() / error
    });
    z.fold(0.0, f64::max)
}

/// Three sets of unknowns × three ways of finding light × 4 rows × 3 channels are 108 tests at 4.5 standard errors:
/// together a false alarm in 1,400 seeds. A tenth too much light must be noticed.
#[test]
fn one_cache_gives_the_radiance_of_any_unknowns_however_light_is_sampled() {
    let scene = room();
    let surfaces = scene.objects.len();
    let values = [0, 1, 2].map(|key| unknowns(surfaces, key));
    let truth = values.each_ref().map(|u| rendered(&scene, u, &[]));
    for sampling in [
        LightSampling::Mis,
        LightSampling::Emitter,
        LightSampling::Bsdf,
    ] {
        let mut rounds = rounds(&scene, sampling, &[]);
        for (key, (unknowns, truth)) in values.iter().zip(&truth).enumerate() {
            let z = worst(&rounds, unknowns, truth);
            assert!(z < 4.5, "{sampling:?}, unknowns {key}: z {z}");
        }
        let clusters = rounds.iter_mut().flat_map(|cache| &mut cache.clusters);
        for vertex in clusters.flat_map(|cluster| &mut cluster.vertices) {
            vertex.lamp_weight *= 1.1;
            if sampling == LightSampling::Bsdf {
                vertex.emission_weight *= 1.1;
            }
        }
        let noticed = (values.iter().zip(&truth)).map(|(u, truth)| worst(&rounds, u, truth));
        let noticed: Vec<f64> = noticed.collect();
        println!("{sampling:?}: {noticed:?}");
        assert!(
            noticed.iter().any(|&z| z > 4.5),
            "{sampling:?}: {noticed:?}"
        );
    }
}

/// Two sets of unknowns × 12 means at 4.5 standard errors. Paths that forget the lobes, and paths of other lobes, must be
/// noticed.
#[test]
fn a_cache_traced_with_lobes_gives_the_radiance_of_any_albedos_under_them() {
    let scene = room();
    let surfaces = scene.objects.len();
    let held = lobes(surfaces);
    let mut narrower = held.clone();
    if let Some(lobe) = &mut narrower[3] {
        lobe.roughness = 0.3;
    }
    let [right, without, other] = [held.as_slice(), &[], narrower.as_slice()]
        .map(|lobes| rounds(&scene, LightSampling::Mis, lobes));
    let mut most = [0.0f64; 3];
    for key in [0, 1] {
        let unknowns = unknowns(surfaces, key);
        let truth = rendered(&scene, &unknowns, &held);
        let z = [&right, &without, &other].map(|rounds| worst(rounds, &unknowns, &truth));
        println!("unknowns {key}: {z:?}");
        most = std::array::from_fn(|i| most[i].max(z[i]));
    }
    assert!(most[0] < 4.5, "{most:?}");
    assert!(most[1] > 4.5 && most[2] > 4.5, "{most:?}");
}

/// The correlation of the two sets, over rounds and rows, is that of chance: 4 of its standard errors, 6e-5.
#[test]
fn the_two_sets_are_independent() {
    let scene = room();
    let unknowns = unknowns(scene.objects.len(), 0);
    let rounds = rounds(&scene, LightSampling::Mis, &[]);
    let means = cached(&rounds, &unknowns);
    let (mut product, mut squares, mut count) = (0.0, [0.0; 2], 0.0f64);
    for cache in &rounds {
        for (row, sets) in residuals(cache, &unknowns).iter().enumerate() {
            let [a, b] = sets.map(|set| -set[0] - means[row][0].mean);
            assert_ne!(a, b);
            let variance = means[row][0].variance();
            product += a * b / variance;
            squares[0] += a * a / variance;
            squares[1] += b * b / variance;
            count += 1.0;
        }
    }
    let correlation = product / (squares[0] * squares[1]).sqrt();
    assert!(
        correlation.abs() < 4.0 / count.sqrt(),
        "correlation {correlation}"
    );
}

#[test]
fn other_samples_give_other_paths_and_the_same_samples_the_same() {
    let scene = room();
    let unknowns = unknowns(scene.objects.len(), 0);
    let (first, again) = (
        rounds(&scene, LightSampling::Mis, &[]),
        rounds(&scene, LightSampling::Mis, &[]),
    );
    assert_eq!(
        residuals(&first[0], &unknowns),
        residuals(&again[0], &unknowns)
    );
    assert_ne!(
        residuals(&first[0], &unknowns),
        residuals(&first[1], &unknowns)
    );
}

/// In a closed box that emits E everywhere and reflects ρ, photographs show L = E/(1 − ρ), and a path that ends there
/// is worth exactly E + ρL.
#[test]
fn paths_that_end_in_photographed_radiance_hold_one_bounce_and_that_radiance() {
    let mesh = scenes::closed_box(1.0, DVec3::ZERO);
    let views: Vec<scenes::View> = (0..6)
        .map(|i| {
            let mut target = DVec3::new(0.0, 0.0, 1e-3);
            target[i / 2] = [-1.0, 1.0][i % 2];
            (DVec3::ZERO, target)
        })
        .collect();
    let capture = scenes::capture(mesh, &views, [24, 24]);
    let scene = Arc::new(Scene::new(&capture).expect("the box is sound"));
    let (albedo, emission) = (Vec3::new(0.7, 0.5, 0.1), Vec3::new(1.0, 2.0, 0.5));
    let level = emission / (Vec3::ONE - albedo);
    let photograph = Arc::new(scenes::photograph([24, 24], vec![level; 576]));
    let problem = Problem {
        scene: scene.clone(),
        photographs: vec![photograph; 6],
    };
    let gbuffer = GBuffer::new(
        &problem,
        HoldOut::from(&Settings::default()),
        Settings::default().seed,
        usize::MAX,
    );
    let measured = MeasuredRadiance::new(&problem, &gbuffer);
    let lights = Emitters::new(&scene, &[1.0; 6]);
    let tracer = Tracer {
        texels: None,
        scene: &scene,
        lights: &lights,
        measured: Some(&measured),
        sky: None,
        outside: None,
        surface_of: &scene.object_of,
        expected_albedo: &[0.5; 6],
        lobes: &[],
        patches: None,
        sampling: LightSampling::Bsdf,
        max_bounces: 1000,
        seed: 1,
        stage: 0,
        round: 0,
    };
    let clusters = [Cluster {
        frame: 0,
        object: 0,
        pixels: (0..576).collect(),
        paths: 4,
        measured: Vec3::ZERO,
        censored: BVec3::FALSE,
        level: Some(Vec3::ZERO),
        dark: Vec3::ONE,
    }];
    let cache = tracer.trace(&clusters);
    let unknowns = Unknowns {
        albedo: vec![albedo; 6],
        emission: vec![emission; 6],
    };
    let [a, b] = residuals(&cache, &unknowns)[0];
    for radiance in [-a, -b] {
        assert!(
            (radiance - level.as_dvec3()).length() < 2e-3 * f64::from(level.length()),
            "{radiance} {level}"
        );
    }
    // Nearly all paths end after one bounce: the photographs see the whole box.
    let vertices = cache.clusters[0].vertices.len() as f64 / cache.clusters[0].ends.len() as f64;
    assert!(vertices < 1.1, "{vertices} vertices a path");
    // Half the light there, seen from a surface that reflects all of it.
    let unknowns = Unknowns {
        albedo: vec![Vec3::ONE; 6],
        emission: vec![Vec3::ZERO; 6],
    };
    let [a, _] = residuals(&cache, &unknowns)[0];
    assert!(
        (-a).cmplt(level.as_dvec3() * 1.001).all() && (-a).cmpgt(level.as_dvec3() * 0.9).all(),
        "{a} {level}"
    );
}

/// Derivative of each row of the picture by the lamp's albedo, in green, over rounds.
fn by_lamp_albedo(rounds: &[PathCache], unknowns: &Unknowns, reflected: &[Vec3]) -> Vec<Moments> {
    let mut place = vec![usize::MAX; 2 * unknowns.surfaces()];
    place[LAMP] = 0;
    let mut moments = vec![Moments::default(); SIZE[1] as usize];
    for cache in rounds {
        for (row, found) in (moments.iter_mut()).zip(cache.linearise(unknowns, &place, reflected)) {
            let both = found
                .rows
                .first()
                .map_or(DVec3::ZERO, |r| (r.1 + r.2) * 0.5);
            row.push(both.y);
        }
    }
    moments
}

/// What a lamp reflects of the room's light is known from its patches: as much of it arrives everywhere as along paths
/// that go on from the lamp, with far less noise. Four standard errors, and 5 % for what differs within a patch.
#[test]
fn patches_of_a_lamp_tell_what_its_albedo_does_as_paths_beyond_it_do() {
    let scene = room();
    let mut unknowns = unknowns(scene.objects.len(), 5);
    unknowns.albedo[LAMP] = Vec3::ZERO;
    let lit = LitScene::new(scene.clone(), materials(&unknowns, &[]), None);
    let mut roles = vec![Role::Reflector; scene.objects.len()];
    roles[LAMP] = Role::Emitter;
    let mut patches = LampPatches::new(&scene, &roles);
    patches.light(&lit, 20_000, &PathOptions::default(), [1, 0]);
    assert_eq!(patches.reflected.len(), scene.objects[LAMP].triangles.len());
    let mis = LightSampling::Mis;
    let beyond = by_lamp_albedo(&rounds(&scene, mis, &[]), &unknowns, &[]);
    let known = rounds_with(&scene, mis, &[], Some(&patches));
    let known = by_lamp_albedo(&known, &unknowns, &patches.reflected);
    let mut quieter = 0;
    for (row, (beyond, known)) in beyond.iter().zip(&known).enumerate() {
        let (a, b) = (beyond.mean, known.mean);
        let error = (beyond.standard_error().powi(2) + known.standard_error().powi(2)).sqrt();
        assert!(a > 8.0 * beyond.standard_error(), "row {row}: {a}");
        assert!(
            (a - b).abs() < 4.0 * error + 0.05 * a,
            "row {row}: {a} {b} +- {error}"
        );
        quieter += usize::from(known.standard_error() * 3.0 < beyond.standard_error());
    }
    assert!(quieter >= 3, "{quieter}");
}
