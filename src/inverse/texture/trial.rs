//! Compares a texture with one colour on pixels outside its fit.

use crate::inverse::texture::SIGNIFICANT;
use crate::inverse::texture::cells::Cells;
use crate::inverse::texture::gloss::{gloss, white_base};
use crate::inverse::texture::look::SeenPixel;
use crate::math::color::luminance;
use crate::math::rng::Stream;
use crate::math::stats::{Moments, quantile};
use crate::transport::arrival::RayCount;
use crate::transport::lit::LitScene;
use crate::transport::path::PathOptions;
use glam::Vec3;
use rayon::prelude::*;

/// First of the sample keys of these paths, disjoint from those of the fits.
const KEY: u64 = 7 << 59;
/// Paths over all pixels, in each of two sets.
const PATHS: usize = 64_000;
/// Least and greatest number of paths per pixel and set.
const PATHS_PER_PIXEL: (usize, usize) = (32, 512);
/// Greatest number of pixels.
const MAX_PIXELS: usize = 2_000;
/// Number of pixels that decide whether the rest is needed.
const FIRST_PIXELS: usize = 250;
/// A gain of this many standard errors on the first pixels is decisive.
const DECISIVE: f64 = 2.0 * SIGNIFICANT;
/// Least number of photographs for a standard error over photographs.
const MIN_PHOTOGRAPHS: f64 = 5.0;
/// The gain of a pixel is clamped to this multiple of the 68th percentile.
const CLIP: f64 = 5.0;

/// The outcome. Errors are squared, relative to the squared level, and averaged over pixels; they include photograph noise.
#[derive(Debug, Clone, Copy, Default)]
pub struct Trial {
    /// Error of one colour.
    pub before: f64,
    /// Error of the texture.
    pub after: f64,
    /// Mean decrease, with clamped outliers.
    pub gain: f64,
    /// Standard error of `gain`.
    pub noise: f64,
    /// Number of pixels.
    pub pixels: usize,
    /// Rays cast and paths rejected; rejected samples count as black in both predictions.
    pub cast: RayCount,
}

/// A pixel, and a texture that was fitted without it.
#[derive(Clone, Copy)]
pub struct TestPixel<'a> {
    /// The pixel.
    pub pixel: &'a SeenPixel,
    /// Albedo of each cell.
    pub colors: &'a [Vec3],
}

/// Compares one colour with a texture on pixels that the texture was fitted without.
///
/// Both are lit by the same full paths from the pixel's hits, in two independent sets whose residuals are multiplied, so that
/// path noise causes no bias. The test ends after the first pixels if these are decisive, or if all pixels together would
/// hardly reach significance. If the surface is `glossy`, errors are correlated within each photograph.
pub fn compare(
    lit: &LitScene,
    cells: &Cells,
    pixels: &[TestPixel],
    constant: Vec3,
    glossy: bool,
    options: &PathOptions,
    seed: u64,
) -> Trial {
    let count = pixels.len().min(MAX_PIXELS);
    let chosen: Vec<TestPixel> = (0..count)
        .map(|i| pixels[i * pixels.len() / count])
        .collect();
    let mut levels: Vec<f64> = (chosen.iter())
        .map(|p| f64::from(luminance(p.pixel.measured)))
        .collect();
    let comparison = Comparison {
        lit,
        cells,
        constant,
        options,
        seed,
        paths: (PATHS / count.max(1)).clamp(PATHS_PER_PIXEL.0, PATHS_PER_PIXEL.1),
        floor: 0.5 * quantile(&mut levels, 0.5).unwrap_or(0.0) as f32,
    };
    let every = count.div_ceil(FIRST_PIXELS).max(1);
    let part = |first: bool| {
        let indices = (0..count).filter(|i| (i % every == 0) == first);
        let pixels: Vec<TestPixel> = indices.map(|i| chosen[i]).collect();
        comparison.compare(&pixels)
    };
    let mut compared = part(true);
    let first = Trial::new(&compared, glossy);
    if !is_decisive(&first) && !is_hopeless(&first, count) {
        compared.extend(part(false));
    }
    Trial::new(&compared, glossy)
}

/// Whether the first pixels decide for the texture.
fn is_decisive(first: &Trial) -> bool {
    first.pixels >= FIRST_PIXELS / 2 && first.gain > DECISIVE * first.noise
}

/// Whether `count` pixels would hardly reach a significant gain, given the first ones and one standard error of luck.
fn is_hopeless(first: &Trial, count: usize) -> bool {
    let growth = (count as f64 / first.pixels.max(1) as f64).sqrt();
    (first.gain / first.noise.max(f64::MIN_POSITIVE) + 1.0) * growth < SIGNIFICANT
}

/// The inputs of both predictions.
struct Comparison<'a> {
    lit: &'a LitScene,
    cells: &'a Cells,
    constant: Vec3,
    options: &'a PathOptions,
    seed: u64,
    /// Paths per pixel and set.
    paths: usize,
    /// Luminance added in quadrature to the level.
    floor: f32,
}

/// Squared relative errors of one pixel.
struct Compared {
    frame: u32,
    flat: f64,
    textured: f64,
    cast: RayCount,
}

impl Comparison<'_> {
    fn compare(&self, pixels: &[TestPixel]) -> Vec<Compared> {
        pixels.par_iter().map(|pixel| self.pixel(pixel)).collect()
    }

    fn pixel(&self, &TestPixel { pixel, colors }: &TestPixel) -> Compared {
        let texture = |hit| {
            let cell = self.cells.locate(hit);
            cell.map_or(self.constant, |c| colors[c as usize])
        };
        let mut cast = RayCount::default();
        let sets = [0u64, 1].map(|set| {
            let (mut flat, mut textured) = (Vec3::ZERO, Vec3::ZERO);
            for path in 0..self.paths {
                let hit = &pixel.hits[path % pixel.hits.len()];
                let sample = KEY + 2 * path as u64 + set;
                let key = (u64::from(pixel.frame), u64::from(pixel.pixel));
                let mut stream = Stream::new(self.seed, key.0, key.1, sample);
                let surface = self.lit.surface(&hit.hit);
                let normal = hit.normal(self.lit);
                let (white, base_cast) =
                    white_base(self.lit, &surface, normal, &mut stream, self.options);
                let (lobe, gloss_cast) = gloss(self.lit, pixel, path, &mut stream, self.options);
                cast += base_cast;
                cast += gloss_cast;
                flat += white * pixel.base * self.constant + lobe;
                textured += white * pixel.base * texture(&hit.hit) + lobe;
            }
            [flat, textured].map(|sum| sum / self.paths as f32)
        });
        let flat = sets.map(|set| set[0]);
        let level = luminance((flat[0] + flat[1]) * 0.5);
        let square = f64::from(level * level + self.floor * self.floor);
        let error = |[a, b]: [Vec3; 2]| {
            let product = (pixel.measured - a) * (pixel.measured - b);
            // The level is zero if everything is black.
            if square > 0.0 {
                f64::from(product.element_sum() / 3.0) / square
            } else {
                0.0
            }
        };
        Compared {
            frame: pixel.frame,
            flat: error(flat),
            textured: error(sets.map(|set| set[1])),
            cast,
        }
    }
}

impl Trial {
    /// Whether the gain is significant.
    pub fn is_gain(&self) -> bool {
        self.gain > SIGNIFICANT * self.noise
    }

    fn new(pixels: &[Compared], glossy: bool) -> Self {
        let mut sizes: Vec<f64> = (pixels.iter())
            .map(|p| (p.flat - p.textured).abs())
            .collect();
        let clip = CLIP * quantile(&mut sizes, 0.68).unwrap_or(0.0);
        let (mut before, mut after) = (Moments::default(), Moments::default());
        let mut gain = Moments::default();
        let gains: Vec<(u32, f64)> = (pixels.iter())
            .map(|p| (p.frame, (p.flat - p.textured).clamp(-clip, clip)))
            .collect();
        for (pixel, &(_, gained)) in pixels.iter().zip(&gains) {
            before.push(pixel.flat);
            after.push(pixel.textured);
            gain.push(gained);
        }
        Self {
            before: before.mean,
            after: after.mean,
            gain: gain.mean,
            noise: if glossy {
                error_by_frame(gains, gain.mean)
            } else {
                gain.standard_error()
            },
            pixels: pixels.len(),
            cast: pixels.iter().map(|p| p.cast).sum(),
        }
    }
}

/// Standard error of the mean of gains that are correlated within each photograph, as the errors of a highlight are; infinite
/// with fewer than [`MIN_PHOTOGRAPHS`] photographs.
fn error_by_frame(mut gains: Vec<(u32, f64)>, mean: f64) -> f64 {
    gains.sort_by_key(|&(frame, _)| frame);
    let sums = (gains.chunk_by(|a, b| a.0 == b.0))
        .map(|frame| frame.iter().map(|(_, gain)| gain - mean).sum::<f64>());
    let (frames, squares) = sums.fold((0.0, 0.0), |(n, s), sum| (n + 1.0, s + sum * sum));
    if frames < MIN_PHOTOGRAPHS {
        return f64::INFINITY;
    }
    (squares * frames / (frames - 1.0)).sqrt() / gains.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten photographs of fifty pixels each, whose gains are equal within each photograph, count as ten measurements.
    #[test]
    fn what_pixels_of_a_photograph_share_counts_once() {
        let of_frame = |frame: u32| f64::from(frame % 5) - 2.0;
        let gains: Vec<(u32, f64)> = (0..500).map(|i| (i % 10, of_frame(i % 10))).collect();
        let error = error_by_frame(gains, 0.0);
        // The variance is 2, the unbiased estimate 20/9; of the mean of ten, 2/9.
        assert!((error - (20.0f64 / 90.0).sqrt()).abs() < 1e-12, "{error}");
        assert_eq!(error_by_frame(vec![(3, 1.0), (3, 2.0)], 1.5), f64::INFINITY);
    }

    #[test]
    fn a_loss_or_a_plain_gain_ends_a_trial_early_and_a_promising_gain_does_not() {
        let first = |gain: f64| Trial {
            gain,
            noise: 1.0,
            pixels: 250,
            ..Trial::default()
        };
        // Eight times the pixels give 2.8 times the significance; one standard error is granted for luck.
        assert!(is_hopeless(&first(-1.0), 2000));
        assert!(is_hopeless(&first(0.3), 2000));
        assert!(!is_hopeless(&first(0.5), 2000));
        assert!(is_decisive(&first(8.5)) && !is_decisive(&first(7.0)));
        // A few pixels are never decisive.
        assert!(!is_decisive(&Trial {
            pixels: 40,
            ..first(50.0)
        }));
        // Without noise, any gain is significant.
        let noise_free = |gain: f64| Trial {
            noise: 0.0,
            ..first(gain)
        };
        assert!(!is_hopeless(&noise_free(1e-9), 2000));
        assert!(is_hopeless(&noise_free(-1e-9), 2000));
    }
}
