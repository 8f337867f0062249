//! Standard errors of a fitted texture, from samples of its posterior.
//!
//! Linearised at the solution, the posterior is a Gaussian with the precision (Σ ω wwᵀ + penalties + τ) / ν², where ν² is the
//! variance of cross-validated pixels about the fit. Perturbing every measurement, difference and prior by its noise and solving
//! again samples that Gaussian without an inverse (Papandreou and Yuille 2010).

use crate::inverse::texture::fit::{Measurements, Texture};
use crate::inverse::texture::fuse::{System, penalties};
use crate::inverse::texture::links::Links;
use crate::inverse::texture::normal_matrix::NormalMatrix;
use crate::math::color::luminance;
use crate::math::rng::Stream;
use glam::Vec3;
use rayon::prelude::*;

/// Number of samples. Pooled with the neighbours', they give a standard deviation to 10 %.
const DRAWS: u64 = 8;
/// First of the sample keys of the draws.
const KEY: u64 = 11 << 58;

/// Standard error of each cell's albedo by the noise of the photographs.
pub fn standard_errors(
    measurements: &Measurements,
    links: &Links,
    texture: &Texture,
    seed: u64,
    object: usize,
) -> Vec<Vec3> {
    let count = texture.colors.len();
    let unit = measurements.unit();
    let strength = texture.strength.unwrap_or(0.0);
    let colors: Vec<Vec3> = texture.colors.iter().map(|c| *c / unit).collect();
    let matrix = NormalMatrix::new(measurements.observations, &measurements.weights, links);
    let penalties = penalties(links, &vec![1.0; count], strength, &colors);
    let system = System::new(&matrix, links, penalties, texture.prior_weight);
    let deviations = (0..DRAWS).into_par_iter().map(|draw| {
        let right = perturbation(&system, measurements, seed, object, draw);
        let mut deviation = vec![Vec3::ZERO; count];
        for _ in 0..3 {
            system.solve(&right, &mut deviation);
        }
        deviation
    });
    let mut squares = vec![Vec3::ZERO; count];
    for deviation in deviations.collect::<Vec<_>>() {
        for (square, d) in squares.iter_mut().zip(&deviation) {
            *square += *d * *d / DRAWS as f32;
        }
    }

    // Neighbours have similar variances, so these are pooled.
    let noise = texture.noise * unit;
    (0..count)
        .into_par_iter()
        .map(|cell| {
            let (mut sum, mut n) = (squares[cell], 1.0);
            for (_, other) in links.neighbours(cell) {
                sum += squares[other];
                n += 1.0;
            }
            (sum / n).powf(0.5) * noise
        })
        .collect()
}

/// Noise of unit variance on every measurement, difference and prior, as a right-hand side.
fn perturbation(
    system: &System,
    measurements: &Measurements,
    seed: u64,
    object: usize,
    draw: u64,
) -> Vec<Vec3> {
    let normal = |kind: u64, index: usize| {
        let mut stream = Stream::new(seed, 3 * object as u64 + kind, index as u64, KEY + draw);
        Vec3::new(stream.normal(), stream.normal(), stream.normal())
    };
    let measured: Vec<Vec3> = (measurements.weights.par_iter().enumerate())
        .map(|(row, weight)| normal(0, row) / weight.max(Vec3::splat(f32::MIN_POSITIVE)).powf(0.5))
        .collect();
    let mut right = (measurements.observations).transpose_times(&measurements.weights, &measured);
    for cell in 0..right.len() {
        for (at, other) in system
            .links
            .neighbours(cell)
            .filter(|&(_, other)| other > cell)
        {
            let noise = normal(1, at) * system.penalties[at].sqrt();
            right[cell] += noise;
            right[other] -= noise;
        }
        right[cell] += normal(2, cell) * system.prior_weight.sqrt();
    }
    right
}

/// Adds the `relative` standard error of the light, by its tracing and the object's overall scale, in quadrature.
pub fn with_light(errors: &[Vec3], texture: &Texture, relative: Vec3) -> Vec<Vec3> {
    let pairs = errors.iter().zip(&texture.colors);
    pairs
        .map(|(error, color)| {
            let light = *color * relative;
            (*error * *error + light * light).powf(0.5)
        })
        .collect()
}

/// Standard deviation of a texture's colours about `mean`, which is the standard error of unseen texels.
pub fn spread(colors: &[Vec3], mean: Vec3) -> Vec3 {
    let sum: Vec3 = colors.iter().map(|c| (*c - mean) * (*c - mean)).sum();
    let spread = (sum / colors.len().max(1) as f32).powf(0.5);
    spread.max(Vec3::splat(luminance(mean) * f32::EPSILON))
}
