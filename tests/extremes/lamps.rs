//! Lamps that are tiny, many, or very unequal.

use crate::{grey, scenes, z};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use relit::capture::mesh::Mesh;
use relit::math::rng::Stream;
use relit::math::stats::Moments;
use relit::scene::Scene;
use relit::scene::geometry::Ray;
use relit::transport::emitters::{Emitters, FenwickTree};
use relit::transport::lit::LitScene;
use relit::transport::material::Material;
use relit::transport::path::{PathOptions, radiance};

/// Radiance seen at a point of the floor, over `paths` paths.
fn seen(lit: &LitScene, target: DVec3, options: &PathOptions, seed: u64, paths: u64) -> Moments {
    let origin = Vec3::new(0.2, 0.1, 0.3);
    let ray = Ray::new(origin, (target.as_vec3() - origin).normalize_or_zero());
    let samples: Vec<f64> = (0..paths)
        .into_par_iter()
        .map(|index| {
            let mut stream = Stream::new(seed, 0, 0, index);
            let sample = radiance(lit, &ray, &mut stream, options);
            assert!(!sample.rejected);
            f64::from(sample.radiance.x)
        })
        .collect();
    let mut moments = Moments::default();
    samples.iter().for_each(|&s| moments.push(s));
    moments
}

/// Direct light of a square lamp at height `y` on the floor (y = −1) under it, by a midpoint rule in f64.
fn direct(half: f64, y: f64, target: DVec3, albedo: f64, emission: f64) -> f64 {
    let n = 200;
    let mut sum = 0.0;
    for i in 0..n * n {
        let at = |i: i32| (f64::from(i) + 0.5) / f64::from(n) * 2.0 - 1.0;
        let to = DVec3::new(at(i / n) * half, y, at(i % n) * half) - target;
        sum += to.y * to.y / to.length_squared().powi(2);
    }
    let area = (2.0 * half).powi(2) / f64::from(n * n);
    albedo * std::f64::consts::FRAC_1_PI * emission * sum * area
}

fn box_with_lamp(half: f64) -> Mesh {
    let mut mesh = scenes::closed_box(1.0, DVec3::ZERO);
    scenes::lamp(&mut mesh, half, DVec3::new(0.0, 0.9, 0.0));
    mesh
}

const TARGETS: [[f64; 3]; 3] = [[0.0, -1.0, 0.0], [0.6, -1.0, -0.5], [-0.9, -1.0, 0.9]];

/// A lamp of a millionth of the room's area. Three tests against quadrature and one against light sampling alone, at four
/// standard errors (6e-5 each).
#[test]
fn a_lamp_of_a_millionth_of_the_rooms_area_is_unbiased() {
    // The box has 24 square units.
    let half = (24e-6f64).sqrt() / 2.0;
    let mut materials = vec![grey(0.6, 0.0); 6];
    materials.push(grey(0.0, 1e6));
    let lit = LitScene::new(scenes::scene_of(box_with_lamp(half)), materials, None);
    let once = PathOptions {
        max_bounces: 1,
        ..Default::default()
    };
    for target in TARGETS.map(DVec3::from_array) {
        let moments = seen(&lit, target, &once, 91, 20_000);
        let truth = direct(half, 0.9, target, 0.6, 1e6);
        let z = z(&moments, truth);
        let error = moments.standard_error() / truth;
        println!(
            "{target}: {} against {truth}, z {z:.2}, error {error:.4}",
            moments.mean
        );
        assert!(z.abs() < 4.0, "{target}: z {z}");
    }
    let target = DVec3::from_array(TARGETS[1]);
    let both = seen(&lit, target, &PathOptions::default(), 92, 40_000);
    let alone = PathOptions {
        sample_bsdf: false,
        ..Default::default()
    };
    let alone = seen(&lit, target, &alone, 93, 40_000);
    let z = (both.mean - alone.mean) / both.standard_error().hypot(alone.standard_error());
    println!(
        "all bounces: {} ± {} against {} ± {}, z {z:.2}",
        both.mean,
        both.standard_error(),
        alone.mean,
        alone.standard_error()
    );
    assert!(z.abs() < 4.0, "z {z}");
}

/// A lamp cut into strips and those into triangles, a million in all, whose areas differ by a hundred and more.
fn shattered_lamp(mesh: &mut Mesh, half: f64, y: f64, columns: usize, rows: usize) {
    mesh.objects.push("lamp".into());
    let object = mesh.objects.len() as u32 - 1;
    let first = mesh.positions.len() as u32;
    // Widths grow along x.
    let edge =
        |i: usize, n: usize, power: i32| ((i as f64 / n as f64).powi(power) * 2.0 - 1.0) * half;
    for i in 0..=columns {
        for j in 0..=rows {
            mesh.positions
                .push(DVec3::new(edge(i, columns, 2), y, edge(j, rows, 1)));
        }
    }
    let at = |i: usize, j: usize| first + (i * (rows + 1) + j) as u32;
    for i in 0..columns {
        for j in 0..rows {
            // Counter-clockwise from below.
            mesh.triangles
                .push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            mesh.triangles
                .push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            mesh.object_of.extend([object; 2]);
        }
    }
}

/// A million triangles give the light of one quad (z-test against quadrature at four standard errors), and each is drawn
/// by its area: chi-square over all of them, its normal approximation at five deviations.
#[test]
fn a_million_emitting_triangles_are_drawn_by_their_area() {
    let mut mesh = scenes::closed_box(1.0, DVec3::ZERO);
    shattered_lamp(&mut mesh, 0.4, 0.9, 1000, 500);
    let scene = scenes::scene_of(mesh);
    let mut materials = vec![grey(0.6, 0.0); 6];
    materials.push(grey(0.0, 5.0));
    let lit = LitScene::new(scene.clone(), materials, None);
    let once = PathOptions {
        max_bounces: 1,
        ..Default::default()
    };
    for target in TARGETS.map(DVec3::from_array) {
        let moments = seen(&lit, target, &once, 94, 20_000);
        let truth = direct(0.4, 0.9, target, 0.6, 5.0);
        let z = z(&moments, truth);
        let error = moments.standard_error() / truth;
        println!(
            "{target}: {} against {truth}, z {z:.2}, error {error:.4}",
            moments.mean
        );
        assert!(z.abs() < 4.0, "{target}: z {z}");
    }
    let chi2 = spread(&scene, &lit.emitters, 6, 8_000_000);
    println!("deviation of the chi-square {chi2:.2}");
    assert!(chi2.abs() < 5.0, "{chi2}");
}

/// Chi-square of draws over an object's triangles with ten or more draws expected, in standard deviations from its mean.
fn spread(scene: &Scene, emitters: &Emitters, object: usize, draws: u64) -> f64 {
    let batches: Vec<Vec<u32>> = (0..16u64)
        .into_par_iter()
        .map(|batch| {
            let mut counts = vec![0u32; scene.triangles.len()];
            let mut stream = Stream::new(95, 0, 0, batch);
            for _ in 0..draws / 16 {
                let (choice, u) = (stream.uniform_f64(), stream.uniform2());
                let (_, sample) = emitters.sample(scene, choice, u).expect("there is a lamp");
                counts[sample.triangle as usize] += 1;
            }
            counts
        })
        .collect();
    let total: f64 = scene.objects[object].area;
    let (mut chi2, mut cells) = (0.0, 0.0);
    for &t in &scene.objects[object].triangles {
        let expected = draws as f64 * f64::from(scene.areas[t as usize]) / total;
        let count: u32 = batches.iter().map(|b| b[t as usize]).sum();
        if expected >= 10.0 {
            chi2 += (f64::from(count) - expected).powi(2) / expected;
            cells += 1.0;
        }
    }
    assert!(cells > 1e5, "{cells}");
    (chi2 - cells) / (2.0f64 * cells).sqrt()
}

/// A triangle of a billionth of its lamp's area is drawn as often as that: of the draws whose first 24 bits fall where it
/// lies, a sixtieth. Four standard errors.
#[test]
fn a_triangle_of_a_billionth_of_its_lamp_is_drawn_by_its_area() {
    let mut mesh = scenes::closed_box(1.0, DVec3::ZERO);
    scenes::lamp(&mut mesh, 0.5, DVec3::new(0.0, 0.9, 0.0));
    let first = mesh.positions.len() as u32;
    let leg = (2e-9f64).sqrt();
    let corners = [[0.0, 0.8, 0.0], [leg, 0.8, 0.0], [0.0, 0.8, leg]];
    mesh.positions.extend(corners.map(DVec3::from_array));
    mesh.triangles.push([first, first + 1, first + 2]);
    mesh.object_of.push(6);
    let scene = scenes::scene_of(mesh);
    let mut weights = [0.0; 7];
    weights[6] = 1.0;
    let emitters = Emitters::new(&scene, &weights);
    let last = 1.0 - 1.0 / 16_777_216.0;
    let mut stream = Stream::new(95, 1, 0, 0);
    let (draws, mut drawn) = (200_000, 0u32);
    for _ in 0..draws {
        let (choice, v) = (stream.uniform_f64(), stream.uniform());
        let (_, sample) = emitters
            .sample(&scene, choice, [last, v])
            .expect("there is a lamp");
        drawn += u32::from(sample.triangle == 14);
    }
    let fraction = f64::from(scene.areas[14]) / scene.objects[6].area * 16_777_216.0;
    let expected = f64::from(draws) * fraction;
    let z = (f64::from(drawn) - expected) / (expected * (1.0 - fraction)).sqrt();
    println!("{drawn} of {expected:.0} expected, z {z:.2}");
    assert!(
        (0.01..0.03).contains(&fraction) && z.abs() < 4.0,
        "{drawn} of {expected}, z {z}"
    );
}

/// Two rooms with nothing between them but their walls: in the dim one a lamp 1e8 times weaker than the other's must
/// give what it gives alone. One test at four standard errors; rays, not luck, must find it.
#[test]
fn a_lamp_a_hundred_million_times_weaker_than_another_still_lights_its_room() {
    let mut pair = box_with_lamp(0.4);
    let mut other = scenes::closed_box(1.0, DVec3::new(5.0, 0.0, 0.0));
    scenes::lamp(&mut other, 0.4, DVec3::new(5.0, 0.9, 0.0));
    let first = pair.positions.len() as u32;
    let objects = pair.objects.len() as u32;
    pair.positions.extend(&other.positions);
    pair.triangles
        .extend(other.triangles.iter().map(|t| t.map(|i| i + first)));
    pair.object_of
        .extend(other.object_of.iter().map(|o| o + objects));
    pair.objects
        .extend(other.objects.iter().map(|name| format!("bright {name}")));
    let mut materials: Vec<Material> = vec![grey(0.6, 0.0); 6];
    materials.push(grey(0.0, 1.0));
    let alone = LitScene::new(
        scenes::scene_of(box_with_lamp(0.4)),
        materials.clone(),
        None,
    );
    materials.extend(vec![grey(0.6, 0.0); 6]);
    materials.push(grey(0.0, 1e8));
    let both = LitScene::new(scenes::scene_of(pair.clone()), materials, None);
    // The pair's scene is recentred on the middle of both.
    let shift = both.scene.origin;
    let options = PathOptions::default();
    let target = DVec3::from_array(TARGETS[1]);
    let wanted = seen(&alone, target, &options, 96, 60_000);
    let samples: Vec<f64> = (0..120_000u64)
        .into_par_iter()
        .map(|index| {
            let mut stream = Stream::new(97, 0, 0, index);
            let origin = DVec3::new(0.2, 0.1, 0.3);
            let direction = (target - origin).normalize_or_zero().as_vec3();
            let ray = Ray::new((origin - shift).as_vec3(), direction);
            f64::from(radiance(&both, &ray, &mut stream, &options).radiance.x)
        })
        .collect();
    let mut found = Moments::default();
    samples.iter().for_each(|&s| found.push(s));
    let z = (found.mean - wanted.mean) / found.standard_error().hypot(wanted.standard_error());
    println!(
        "{} ± {} against {} ± {}, z {z:.2}",
        found.mean,
        found.standard_error(),
        wanted.mean,
        wanted.standard_error()
    );
    assert!(z.abs() < 4.0, "z {z}");
    assert!(
        found.standard_error() < 0.03 * wanted.mean,
        "too noisy to tell"
    );
}

/// Ten million updates over thirty decades: every probability within 1e-12 of the exact one.
#[test]
fn the_tree_of_weights_does_not_drift_in_ten_million_updates() {
    let n = 300;
    let mut weights = vec![0.0f64; n];
    let mut tree = FenwickTree::new(&weights);
    let mut stream = Stream::new(98, 0, 0, 0);
    for _ in 0..10_000_000 {
        let bits = stream.next_u32();
        let i = bits as usize % n;
        let decade = (bits >> 16) % 40;
        // A quarter are switched off.
        weights[i] = if decade >= 30 {
            0.0
        } else {
            f64::from(bits | 1) * 10f64.powi(decade as i32 - 25)
        };
        tree.set(i, weights[i]);
    }
    let total: f64 = weights.iter().sum();
    for (i, w) in weights.iter().enumerate() {
        let error = (tree.probability(i) - w / total).abs();
        assert!(error <= 1e-12, "{i}: {error:e}");
    }
}

/// Weights over 600 decades with zeros among them: at every end of every share, and one step of f64 to either side.
#[test]
fn a_zero_weight_is_never_drawn_even_at_the_ends_of_fractions() {
    let mut stream = Stream::new(99, 0, 0, 0);
    for n in [1usize, 2, 5, 64, 1000] {
        let mut weights: Vec<f64> = (0..n)
            .map(|_| {
                if stream.uniform() < 0.5 {
                    0.0
                } else {
                    10f64.powf(600.0 * stream.uniform_f64() - 300.0)
                }
            })
            .collect();
        weights[n / 2] = 1.0;
        let tree = FenwickTree::new(&weights);
        let total = tree.total();
        let mut sum = 0.0;
        let mut ends = vec![0.0, 1.0f64.next_down(), f64::MIN_POSITIVE];
        for w in &weights {
            sum += w;
            let u: f64 = sum / total;
            ends.extend([u, u.next_down(), u.next_up()]);
        }
        for u in ends.into_iter().filter(|u| (0.0..1.0).contains(u)) {
            let drawn = tree.sample(u).expect("a weight is positive");
            assert!(weights[drawn] > 0.0, "{n} weights, u {u:e}: {drawn}");
        }
    }
}
