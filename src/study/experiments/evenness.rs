//! Noise of a pixel's mean radiance with random numbers and with a low-discrepancy sequence.

use crate::calibrate::problem::Problem;
use crate::inverse::paths::derivative::{Gradient, differentiate};
use crate::inverse::settings::LightSampling;
use crate::inverse::unknowns::Unknowns;
use crate::math::color::luminance;
use crate::math::rng::Stream;
use crate::math::sequence::{SequencePoint, Uniforms};
use crate::math::stats::Moments;
use crate::study::experiments::gradient::{lamps, tracer};
use rayon::prelude::*;

/// First key of the random numbers.
const KEY: u64 = 0x6576_656e;
/// Independent repetitions of each mean.
const REPETITIONS: u64 = 16;
/// Most bounces.
const BOUNCES: u32 = 64;

/// Noise for a number of paths.
#[derive(Debug, Clone, Copy)]
pub struct Evenness {
    /// Paths per pixel.
    pub paths: u64,
    /// Relative standard deviation of the mean with random numbers, root mean square over pixels.
    pub random: f64,
    /// The same with a low-discrepancy sequence.
    pub sequence: f64,
}

/// Measures the noise at 1, 4, 16, … up to `max` paths, on `pixels` pixels spread evenly over all photographs; leaves out those
/// without light.
pub fn measure(problem: &Problem, truth: &Unknowns, pixels: usize, max: u64) -> Vec<Evenness> {
    let counts: Vec<u64> = (0..)
        .map(|k| 4u64.pow(k))
        .take_while(|&n| n <= max)
        .collect();
    let all: Vec<(usize, usize)> = (problem.photographs.iter().enumerate())
        .flat_map(|(frame, p)| (0..p.pixels.len()).map(move |pixel| (frame, pixel)))
        .collect();
    let squares: Vec<[Vec<f64>; 2]> = (0..pixels)
        .into_par_iter()
        .map(|index| {
            let (frame, pixel) = all[(2 * index + 1) * all.len() / (2 * pixels)];
            let at = [frame as u64, pixel as u64];
            let random = |repetition, index| Stream::new(KEY + repetition, at[0], at[1], index);
            let sequence =
                |repetition, index| SequencePoint::new(KEY, [at[0], at[1], repetition], index);
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
    let believed: Vec<f32> = truth.albedo.iter().map(|a| a.max_element()).collect();
    let tracer = tracer(scene, &lights, &believed, LightSampling::Mis, BOUNCES);
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
    means
        .iter()
        .map(|m| m.variance() / (level * level))
        .collect()
}
