//! Compares a texture with one colour on pixels outside its fit.

use crate::inverse::texture::SIGNIFICANT;
use crate::inverse::texture::cells::Cells;
use crate::inverse::texture::gloss::{gloss, white_base};
use crate::inverse::texture::look::SeenPixel;
use crate::math::color::luminance;
use crate::math::rng::Stream;
use crate::math::stats::{Moments, quantile, without_outliers};
use crate::transport::arrival::RayCount;
use crate::transport::lit::LitScene;
use crate::transport::path::PathOptions;
use glam::{DVec3, UVec2, Vec3};
use rayon::prelude::*;
use std::collections::BTreeMap;

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
/// Blocks along a side of the picture of a glossy object in each photograph.
const BLOCKS: u32 = 4;
/// Least number of photographs, and of blocks, for a standard error over blocks.
const MIN_PHOTOGRAPHS: usize = 2;
const MIN_BLOCKS: f64 = 8.0;

/// The outcome. Errors are squared, relative to the squared level, and averaged over pixels; they include photograph noise.
#[derive(Debug, Clone, Copy, Default)]
pub struct Trial {
    /// Error of the best single colour.
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

/// Compares a texture with one colour on pixels that the texture was fitted without.
///
/// The one colour is the best for these pixels, so that a texture gains nothing by being brighter or darker as a whole.
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
        comparison.predict(&pixels)
    };
    let mut predicted = part(true);
    let first = Trial::new(&predicted, glossy);
    if !is_decisive(&first) && !is_hopeless(&first, count) {
        predicted.extend(part(false));
    }
    Trial::new(&predicted, glossy)
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

/// One pixel, and radiance that was predicted for it by two independent sets of paths.
struct Predicted {
    frame: u32,
    /// Column and row in the photograph.
    at: UVec2,
    measured: Vec3,
    /// Of a white base without the lobe.
    white: [Vec3; 2],
    /// Of the lobe.
    lobe: [Vec3; 2],
    /// With the texture.
    textured: [Vec3; 2],
    /// Inverse of the squared level; zero if everything is black.
    weight: f32,
    cast: RayCount,
}

impl Comparison<'_> {
    fn predict(&self, pixels: &[TestPixel]) -> Vec<Predicted> {
        pixels.par_iter().map(|pixel| self.pixel(pixel)).collect()
    }

    fn pixel(&self, &TestPixel { pixel, colors }: &TestPixel) -> Predicted {
        let texture = |hit| {
            let cell = self.cells.locate(hit);
            cell.map_or(self.constant, |c| colors[c as usize])
        };
        let mut cast = RayCount::default();
        let sets = [0u64, 1].map(|set| {
            let [mut bright, mut mirrored, mut textured] = [Vec3::ZERO; 3];
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
                bright += white * pixel.base;
                mirrored += lobe;
                textured += white * pixel.base * texture(&hit.hit) + lobe;
            }
            [bright, mirrored, textured].map(|sum| sum / self.paths as f32)
        });
        let [white, lobe, textured] = [0, 1, 2].map(|of| sets.map(|set| set[of]));
        let level = luminance(white[0] + white[1]) * 0.5 * luminance(self.constant)
            + luminance(lobe[0] + lobe[1]) * 0.5;
        let square = level * level + self.floor * self.floor;
        let camera = &self.lit.scene.cameras[pixel.frame as usize];
        let width = camera.intrinsics.width;
        Predicted {
            frame: pixel.frame,
            at: UVec2::new(pixel.pixel % width, pixel.pixel / width),
            measured: pixel.measured,
            white,
            lobe,
            textured,
            weight: if square > 0.0 { square.recip() } else { 0.0 },
            cast,
        }
    }
}

impl Predicted {
    /// Squared relative error of a prediction.
    fn error(&self, [a, b]: [Vec3; 2]) -> f64 {
        let product = (self.measured - a) * (self.measured - b) * self.weight;
        f64::from(product.element_sum() / 3.0)
    }

    /// The prediction with one albedo.
    fn with(&self, albedo: Vec3) -> [Vec3; 2] {
        [0, 1].map(|set| self.white[set] * albedo + self.lobe[set])
    }
}

/// The albedo with the least squared relative error; zero in channels without light.
fn best_constant(pixels: &[Predicted]) -> Vec3 {
    let (mut lit, mut white) = (DVec3::ZERO, DVec3::ZERO);
    for pixel in pixels {
        let [a, b] = [0, 1].map(|set| (pixel.measured - pixel.lobe[set]) * pixel.white[1 - set]);
        lit += (0.5 * pixel.weight * (a + b)).as_dvec3();
        white += (pixel.weight * pixel.white[0] * pixel.white[1]).as_dvec3();
    }
    DVec3::select(white.cmpgt(DVec3::ZERO), lit / white, DVec3::ZERO).as_vec3()
}

impl Trial {
    /// Whether the gain is significant.
    pub fn is_gain(&self) -> bool {
        self.gain > SIGNIFICANT * self.noise
    }

    fn new(pixels: &[Predicted], glossy: bool) -> Self {
        let constant = best_constant(pixels);
        let errors: Vec<[f64; 2]> = (pixels.iter())
            .map(|p| [p.with(constant), p.textured].map(|prediction| p.error(prediction)))
            .collect();
        let gains: Vec<f64> = (errors.iter())
            .map(|[flat, textured]| flat - textured)
            .collect();
        let gains = without_outliers(&gains);
        let mut moments = [Moments::default(); 3];
        for ([flat, textured], &gain) in errors.iter().zip(&gains) {
            moments[0].push(*flat);
            moments[1].push(*textured);
            moments[2].push(gain);
        }
        let [before, after, gain] = moments;
        Self {
            before: before.mean,
            after: after.mean,
            gain: gain.mean,
            noise: if glossy {
                let seen: Vec<(u32, UVec2)> = pixels.iter().map(|p| (p.frame, p.at)).collect();
                error_by_block(&seen, &gains, gain.mean)
            } else {
                gain.standard_error()
            },
            pixels: pixels.len(),
            cast: pixels.iter().map(|p| p.cast).sum(),
        }
    }
}

/// Standard error of the mean of gains that are correlated within each block of a photograph, as the errors of a highlight are;
/// infinite with fewer than [`MIN_PHOTOGRAPHS`] photographs or [`MIN_BLOCKS`] blocks.
fn error_by_block(pixels: &[(u32, UVec2)], gains: &[f64], mean: f64) -> f64 {
    let mut frames: BTreeMap<u32, (UVec2, UVec2)> = BTreeMap::new();
    for &(frame, at) in pixels {
        let bounds = frames.entry(frame).or_insert((at, at));
        *bounds = (bounds.0.min(at), bounds.1.max(at));
    }
    let mut sums: BTreeMap<(u32, [u32; 2]), f64> = BTreeMap::new();
    for (&(frame, at), gain) in pixels.iter().zip(gains) {
        let (least, greatest) = frames[&frame];
        let block = (at - least) * BLOCKS / (greatest - least + 1);
        *sums.entry((frame, block.to_array())).or_default() += gain - mean;
    }
    let blocks = sums.len() as f64;
    if frames.len() < MIN_PHOTOGRAPHS || blocks < MIN_BLOCKS {
        return f64::INFINITY;
    }
    let squares: f64 = sums.values().map(|sum| sum * sum).sum();
    (squares * blocks / (blocks - 1.0)).sqrt() / gains.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A texture that has the right colour everywhere is no better than the best single colour.
    #[test]
    fn a_texture_is_compared_with_the_best_single_colour() {
        let pixels: Vec<Predicted> = (1..101u32)
            .map(|i| {
                let white = Vec3::splat(i as f32);
                Predicted {
                    frame: i % 4,
                    at: UVec2::new(i % 10, i / 10),
                    measured: 0.5 * white + 0.1,
                    white: [1.1 * white, white / 1.1],
                    lobe: [Vec3::splat(0.1); 2],
                    textured: [0.5 * 1.1 * white + 0.1, 0.5 / 1.1 * white + 0.1],
                    weight: 1.0 / (white.x * white.x),
                    cast: RayCount::default(),
                }
            })
            .collect();
        let found = best_constant(&pixels);
        let expected = 0.5 * 0.5 * (1.1 + 1.0 / 1.1);
        assert!((found - expected).abs().max_element() < 1e-6, "{found}");
        assert!(!Trial::new(&pixels, false).is_gain());
    }

    /// Two photographs of 8 × 8 pixels, whose gains are equal within blocks of 2 × 2, count as 32 measurements; one photograph
    /// counts as none.
    #[test]
    fn what_pixels_of_a_block_share_counts_once() {
        let photograph = |frame: u32| {
            (0..64u32).map(move |i| {
                let at = UVec2::new(5 + i % 8, 9 + i / 8);
                ((frame, at), f64::from((i % 8 / 2 + i / 16) % 2) - 0.5)
            })
        };
        let (pixels, gains): (Vec<(u32, UVec2)>, Vec<f64>) =
            photograph(3).chain(photograph(4)).unzip();
        let error = error_by_block(&pixels, &gains, 0.0);
        // The unbiased variance of a block is 1/4 · 32/31; of the mean of 32, a 32th of it.
        assert!((error - (0.25 / 31.0f64).sqrt()).abs() < 1e-12, "{error}");
        assert_eq!(
            error_by_block(&pixels[..64], &gains[..64], 0.0),
            f64::INFINITY
        );
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
