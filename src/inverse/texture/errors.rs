//! Standard errors of a fitted texture, by drawing from what the fit leaves open.
//!
//! Linearised at the solution, fit and penalty are a Gaussian with the precision (Σ ω wwᵀ + penalties) / ν², where ν²
//! is the variance that pixels left out of the fit show about it. Perturbing every measurement and every difference
//! by its own noise and solving again draws from that Gaussian (Papandreou and Yuille 2010), so no inverse is needed.

use crate::inverse::texture::fit::{Measurements, Texture};
use crate::inverse::texture::fuse::{System, penalties};
use crate::inverse::texture::links::Links;
use crate::math::color::luminance;
use crate::math::rng::Stream;
use glam::Vec3;
use rayon::prelude::*;

/// Draws; a standard deviation from so many, pooled with the neighbours', is known to about a tenth.
const DRAWS: u64 = 8;
/// First of the sample keys of the draws.
const KEY: u64 = 11 << 58;

/// The standard error of each cell's albedo that the photographs' noise leaves.
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
    let system = System {
        observations: &measurements.observations,
        row_weights: &measurements.weights,
        links,
        penalties: penalties(links, &vec![1.0; count], strength, &colors),
        tether: 1e-5,
    };
    let data = measurements.observations.diagonal(&measurements.weights);
    let mut squares = vec![Vec3::ZERO; count];
    for draw in 0..DRAWS {
        let right = perturbation(&system, seed, object, draw);
        let mut deviation = vec![Vec3::ZERO; count];
        for _ in 0..3 {
            system.solve(&data, &right, &mut deviation);
        }
        for (square, d) in squares.iter_mut().zip(&deviation) {
            *square += *d * *d / DRAWS as f32;
        }
    }

    // Neighbours' variances are much alike, and pooled they are better known.
    let noise = texture.noise * unit;
    (0..count)
        .into_par_iter()
        .map(|cell| {
            let (mut sum, mut n) = (squares[cell], 1.0);
            for (_, other) in links.of(cell) {
                sum += squares[other];
                n += 1.0;
            }
            (sum / n).powf(0.5) * noise
        })
        .collect()
}

/// Noise of unit variance on every measurement and every difference, as a right-hand side.
fn perturbation(system: &System, seed: u64, object: usize, draw: u64) -> Vec<Vec3> {
    let normal = |kind: u64, index: usize| {
        let mut stream = Stream::new(seed, 2 * object as u64 + kind, index as u64, KEY + draw);
        Vec3::new(stream.normal(), stream.normal(), stream.normal())
    };
    let measured: Vec<Vec3> = (system.row_weights.par_iter().enumerate())
        .map(|(row, weight)| normal(0, row) / weight.max(Vec3::splat(f32::MIN_POSITIVE)).powf(0.5))
        .collect();
    let mut right = system.observations.gathered(system.row_weights, &measured);
    for cell in 0..right.len() {
        for (at, other) in system.links.of(cell).filter(|&(_, other)| other > cell) {
            let pull = normal(1, at) * system.penalties[at].sqrt();
            right[cell] += pull;
            right[other] -= pull;
        }
    }
    right
}

/// The standard errors with those of the light added: of its smoothing and of the object's overall scale.
pub fn with_light(errors: &[Vec3], texture: &Texture, relative: Vec3) -> Vec<Vec3> {
    let pairs = errors.iter().zip(&texture.colors);
    pairs
        .map(|(error, color)| {
            let light = *color * relative;
            (*error * *error + light * light).powf(0.5)
        })
        .collect()
}

/// The spread of a texture's colours: what is known of a place that no pixel sees.
pub fn spread(colors: &[Vec3], mean: Vec3) -> Vec3 {
    let sum: Vec3 = colors.iter().map(|c| (*c - mean) * (*c - mean)).sum();
    let spread = (sum / colors.len().max(1) as f32).powf(0.5);
    spread.max(Vec3::splat(luminance(mean) * f32::EPSILON))
}
