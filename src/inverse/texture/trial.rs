//! Whether a texture explains pixels that no fit has seen better than one colour does.

use super::cells::Cells;
use super::look::SeenPixel;
use crate::math::color::luminance;
use crate::math::rng::Stream;
use crate::math::stats::{Moments, quantile};
use crate::transport::lit::Lit;
use crate::transport::path::{PathOptions, white_radiance};
use glam::Vec3;
use rayon::prelude::*;

/// First of the sample keys of these paths, far from those of the fits.
const KEY: u64 = 7 << 59;
/// Paths over all pixels, in each of two sets.
const PATHS: usize = 64_000;
/// Paths a pixel at least and at most, in each set.
const PATHS_A_PIXEL: (usize, usize) = (32, 512);
/// Pixels used at most.
const MOST_PIXELS: usize = 2_000;
/// One pixel's gain counts up to so many times what two of three stay below.
const CLIP: f64 = 5.0;

/// The outcome: squared errors relative to the squared level, mean over held-out pixels, noise of the photographs
/// included.
#[derive(Debug, Clone, Copy, Default)]
pub struct Trial {
    /// Of one colour.
    pub before: f64,
    /// Of the texture.
    pub after: f64,
    /// Mean of the difference, single pixels held back from deciding alone.
    pub gain: f64,
    /// Standard error of `gain`.
    pub noise: f64,
    /// Pixels.
    pub pixels: usize,
    /// Rays cast.
    pub rays: u64,
}

/// A pixel, and the texture that was fitted without it.
#[derive(Clone, Copy)]
pub struct Untouched<'a> {
    /// The pixel.
    pub pixel: &'a SeenPixel,
    /// Albedo of each cell.
    pub colors: &'a [Vec3],
}

/// Compares one colour and a texture on pixels that the texture was fitted without.
///
/// Both see the same light: full paths from the pixel's own points, in two independent sets whose errors are
/// multiplied, so that the noise of the paths favours neither.
pub fn try_out(
    lit: &Lit,
    cells: &Cells,
    pixels: &[Untouched],
    constant: Vec3,
    options: &PathOptions,
    seed: u64,
) -> Trial {
    let count = pixels.len().min(MOST_PIXELS);
    let chosen: Vec<Untouched> = (0..count)
        .map(|i| pixels[i * pixels.len() / count])
        .collect();
    let paths = (PATHS / count.max(1)).clamp(PATHS_A_PIXEL.0, PATHS_A_PIXEL.1);
    let traced: Vec<([Vec3; 2], [Vec3; 2], u64)> = chosen
        .par_iter()
        .map(|&Untouched { pixel, colors }| {
            let texture = |hit| cells.locate(hit).map_or(constant, |c| colors[c as usize]);
            let mut rays = 0;
            let [a, b] = [0u64, 1].map(|set| {
                let (mut flat, mut textured) = (Vec3::ZERO, Vec3::ZERO);
                for path in 0..paths {
                    let landing = &pixel.landings[path % pixel.landings.len()];
                    let sample = KEY + 2 * path as u64 + set;
                    let key = (u64::from(pixel.frame), u64::from(pixel.pixel));
                    let mut stream = Stream::new(seed, key.0, key.1, sample);
                    let surface = lit.surface(&landing.hit);
                    let normal = if landing.front {
                        surface.normal
                    } else {
                        -surface.normal
                    };
                    let path = white_radiance(lit, &surface, normal, &mut stream, options);
                    rays += u64::from(path.rays);
                    flat += path.radiance * constant;
                    textured += path.radiance * texture(&landing.hit);
                }
                [flat / paths as f32, textured / paths as f32]
            });
            ([a[0], b[0]], [a[1], b[1]], rays)
        })
        .collect();

    let mut levels: Vec<f64> = chosen
        .iter()
        .map(|p| f64::from(luminance(p.pixel.measured)))
        .collect();
    let floor = 0.5 * quantile(&mut levels, 0.5).unwrap_or(0.0) as f32;
    let error = |measured: Vec3, [a, b]: [Vec3; 2], level: f32| {
        let product = (measured - a) * (measured - b);
        f64::from(
            product.element_sum() / (3.0 * (level * level + floor * floor).max(f32::MIN_POSITIVE)),
        )
    };
    let (mut before, mut after) = (Moments::default(), Moments::default());
    let mut gains = Vec::with_capacity(count);
    let mut rays = 0;
    for (Untouched { pixel, .. }, (flat, textured, cast)) in chosen.iter().zip(traced) {
        let level = luminance((flat[0] + flat[1]) * 0.5);
        let errors = [flat, textured].map(|sets| error(pixel.measured, sets, level));
        before.push(errors[0]);
        after.push(errors[1]);
        gains.push(errors[0] - errors[1]);
        rays += cast;
    }
    let mut sizes: Vec<f64> = gains.iter().map(|g| g.abs()).collect();
    let clip = CLIP * quantile(&mut sizes, 0.68).unwrap_or(0.0);
    let mut gain = Moments::default();
    gains.iter().for_each(|g| gain.push(g.clamp(-clip, clip)));
    Trial {
        before: before.mean,
        after: after.mean,
        gain: gain.mean,
        noise: gain.standard_error(),
        pixels: count,
        rays,
    }
}
