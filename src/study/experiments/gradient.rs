//! Noise of single-path derivatives, and of a pixel's mean radiance with random numbers and with a low-discrepancy sequence.

use crate::calibrate::problem::Problem;
use crate::inverse::paths::derivative::{Gradient, differentiate};
use crate::inverse::paths::trace::Tracer;
use crate::inverse::settings::LightSampling;
use crate::inverse::unknowns::Unknowns;
use crate::math::color::luminance;
use crate::math::rng::Stream;
use crate::math::sequence::{SequencePoint, Uniforms};
use crate::math::stats::Moments;
use crate::scene::Scene;
use crate::transport::emitters::{Emitters, powers};
use crate::transport::material::Lobe;
use glam::Vec3;
use rayon::prelude::*;

/// Key of the paths; differs from those of solvers.
const KEY: u64 = 0x6772_6164;
/// Bounces, as in the paper.
const BOUNCES: u32 = 2;

/// Noise of the derivative of a pixel's radiance from one path.
#[derive(Debug, Clone, Copy)]
pub struct Noise {
    /// Variance between paths of a pixel, summed over unknowns and channels, averaged over pixels. Derivatives by emission are
    /// multiplied by its value, so that all are radiances.
    pub variance: f64,
    /// Its standard error over pixels.
    pub error: f64,
    pub rays: f64,
}

/// The noise at given unknowns, with `paths` paths for each of `pixels` pixels spread over all photographs. Lobes are constant.
pub fn noise(
    problem: &Problem,
    unknowns: &Unknowns,
    lobes: &[Option<Lobe>],
    sampling: LightSampling,
    pixels: usize,
    paths: u64,
) -> Noise {
    let scene = &*problem.scene;
    let lights = lamps(scene, &unknowns.emission);
    let expected = vec![1.0; unknowns.surfaces()];
    let tracer = Tracer {
        lobes,
        ..tracer(scene, &lights, &expected, sampling, BOUNCES)
    };
    let all = pixels_of(problem);
    let count = pixels.min(all.len());
    let found: Vec<(f64, u64)> = (0..count)
        .into_par_iter()
        .map(|index| {
            let (frame, pixel) = all[index * all.len() / count];
            of_pixel(problem, &tracer, unknowns, frame, pixel, paths)
        })
        .collect();
    let variance: Moments = found.iter().map(|(value, _)| *value).collect();
    let rays: u64 = found.iter().map(|(_, rays)| rays).sum();
    Noise {
        variance: variance.mean,
        error: variance.standard_error(),
        rays: rays as f64 / (count as u64 * paths).max(1) as f64,
    }
}

/// Frame and index of every pixel of all photographs.
fn pixels_of(problem: &Problem) -> Vec<(usize, usize)> {
    (problem.photographs.iter().enumerate())
        .flat_map(|(frame, p)| (0..p.pixels.len()).map(move |pixel| (frame, pixel)))
        .collect()
}

/// A tracer of paths with one surface per object, lit only by lamps of the mesh.
pub fn tracer<'a>(
    scene: &'a Scene,
    lights: &'a Emitters,
    expected_albedo: &'a [f32],
    sampling: LightSampling,
    max_bounces: u32,
) -> Tracer<'a> {
    Tracer {
        scene,
        lights,
        measured: None,
        surface_of: &scene.object_of,
        expected_albedo,
        texels: None,
        lobes: &[],
        patches: None,
        sky: None,
        outside: None,
        sampling,
        max_bounces,
        seed: KEY,
        stage: 0,
        round: 0,
    }
}

/// Emitters of the mesh, weighted by area × luminance.
fn lamps(scene: &Scene, emission: &[Vec3]) -> Emitters {
    Emitters::new(scene, &powers(scene, emission.iter().copied()))
}

/// Summed variance of a pixel's derivatives, and the rays cast.
fn of_pixel(
    problem: &Problem,
    tracer: &Tracer,
    unknowns: &Unknowns,
    frame: usize,
    pixel: usize,
    paths: u64,
) -> (f64, u64) {
    let camera = &problem.scene.cameras[frame];
    let corner = camera.corner(pixel);
    let parameters = 2 * unknowns.surfaces();
    let mut gradient = Gradient::new(parameters);
    let (mut vertices, mut gathered) = (Vec::new(), Vec::new());
    let mut moments = vec![[Moments::default(); 3]; parameters];
    let mut rays = 0;
    for path in 0..paths {
        let mut stream = Stream::new(KEY, frame as u64, pixel as u64, path);
        vertices.clear();
        let cast = tracer.pixel_path(camera, corner, &mut stream, &mut vertices);
        rays += cast.rays;
        gradient.clear();
        differentiate(&vertices, unknowns, &[], &mut gathered, &mut gradient);
        for (parameter, moments) in moments.iter_mut().enumerate() {
            let mut value = Vec3::from(gradient.values[parameter]);
            if parameter >= unknowns.surfaces() {
                value *= unknowns.value(parameter);
            }
            for (channel, moments) in moments.iter_mut().enumerate() {
                moments.push(f64::from(value[channel]));
            }
        }
    }
    (moments.iter().flatten().map(Moments::variance).sum(), rays)
}

/// First key of the random numbers.
const EVENNESS_KEY: u64 = 0x6576_656e;
/// Independent repetitions of each mean.
const REPETITIONS: u64 = 16;
/// Most bounces.
const MAX_BOUNCES: u32 = 64;

/// Noise for a number of paths.
#[derive(Debug, Clone, Copy)]
pub struct Evenness {
    pub paths: u64,
    /// Relative standard deviation of the mean with random numbers, root mean square over pixels.
    pub random: f64,
    /// The same with a low-discrepancy sequence.
    pub sequence: f64,
}

/// The noise at 1, 4, 16, … up to `max` paths, on `pixels` lit pixels spread evenly over all photographs.
pub fn evenness(problem: &Problem, truth: &Unknowns, pixels: usize, max: u64) -> Vec<Evenness> {
    let powers = (0..).map(|k| 4u64.pow(k));
    let counts: Vec<u64> = powers.take_while(|&n| n <= max).collect();
    let all = pixels_of(problem);
    let squares: Vec<[Vec<f64>; 2]> = (0..pixels)
        .into_par_iter()
        .map(|index| {
            let (frame, pixel) = all[(2 * index + 1) * all.len() / (2 * pixels)];
            let at = [frame as u64, pixel as u64];
            let random =
                |repetition, index| Stream::new(EVENNESS_KEY + repetition, at[0], at[1], index);
            let sequence = |repetition, index| {
                SequencePoint::new(EVENNESS_KEY, [at[0], at[1], repetition], index)
            };
            [
                variances(problem, truth, (frame, pixel), &counts, random),
                variances(problem, truth, (frame, pixel), &counts, sequence),
            ]
        })
        .collect();
    (counts.iter().enumerate())
        .map(|(place, &paths)| {
            let root = |kind: usize| {
                let known: Vec<f64> = (squares.iter().map(|s| s[kind][place]))
                    .filter(|v| v.is_finite())
                    .collect();
                (known.iter().sum::<f64>() / known.len().max(1) as f64).sqrt()
            };
            Evenness {
                paths,
                random: root(0),
                sequence: root(1),
            }
        })
        .collect()
}

/// For each of `counts`: relative variance, between repetitions, of the mean over that many paths.
fn variances<U: Uniforms>(
    problem: &Problem,
    truth: &Unknowns,
    (frame, pixel): (usize, usize),
    counts: &[u64],
    numbers: impl Fn(u64, u64) -> U,
) -> Vec<f64> {
    let scene = &*problem.scene;
    let lights = lamps(scene, &truth.emission);
    let expected: Vec<f32> = truth.albedo.iter().map(|a| a.max_element()).collect();
    let tracer = tracer(scene, &lights, &expected, LightSampling::Mis, MAX_BOUNCES);
    let camera = &scene.cameras[frame];
    let (mut vertices, mut gathered) = (Vec::new(), Vec::new());
    let mut gradient = Gradient::new(2 * truth.surfaces());
    let mut means = vec![Moments::default(); counts.len()];
    for repetition in 0..REPETITIONS {
        let (mut sum, mut next) = (0.0, 0);
        for (&count, means) in counts.iter().zip(&mut means) {
            while next < count {
                vertices.clear();
                gradient.clear();
                let mut numbers = numbers(repetition, next);
                tracer.pixel_path(camera, camera.corner(pixel), &mut numbers, &mut vertices);
                let radiance = differentiate(&vertices, truth, &[], &mut gathered, &mut gradient);
                sum += f64::from(luminance(radiance));
                next += 1;
            }
            means.push(sum / count as f64);
        }
    }
    let level = means.last().map_or(0.0, |m| m.mean);
    let relative = |m: &Moments| m.variance() / (level * level);
    means.iter().map(relative).collect()
}
