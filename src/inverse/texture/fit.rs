//! The albedo of an object's cells from its pixels, smoothed as far as pixels left out of the fit ask for.

use crate::inverse::texture::fuse::{Problem, fuse, mean, mean_channel};
use crate::inverse::texture::links::Links;
use crate::inverse::texture::look::{FOLDS, SeenPixel};
use crate::inverse::texture::observations::Observations;
use crate::math::color::luminance;
use crate::math::stats::quantile;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// So many pixels left out are enough to choose by.
const ENOUGH: usize = 4_000;
/// The strongest smoothing tried, for one pixel a cell, and the factor to the next.
const STRONGEST: f32 = 2.0;
const FACTOR: f32 = 0.5;
/// The weakest, and how many worse ones in a row end the search.
const WEAKEST: f32 = 1e-3;
const PATIENCE: u32 = 3;
/// Albedos are counted in the object's own luminance, but never in less than this.
const MIN_UNIT: f32 = 1e-4;
/// Below this fraction of the object's median level, pixels weigh no more for being darker.
const DARK: f32 = 0.5;
/// Light that a channel must receive, in means over the object's pixels.
const MIN_LIGHT: f32 = 1e-6;
/// Turns in which one colour and the lower bounds that it keeps are found.
const BOUND_TURNS: u32 = 3;
/// Squared residuals count up to so many times their median.
const CLIP: f64 = 30.0;

/// The pixels of an object that are in the fit, as measurements of its albedo.
#[derive(Debug, Clone)]
pub struct Measurements {
    /// Which cells each pixel sees.
    pub observations: Observations,
    /// Measured radiance, less that of a lobe, over that of a white surface.
    pub albedo: Vec<Vec3>,
    /// Weight of each channel of each: the squared radiance of a white surface over the pixel's variance, on average 1; zero
    /// of lower bounds that the fit lies above.
    pub weights: Vec<Vec3>,
    /// Which are lower bounds, as their pixels are saturated.
    bounds: Vec<bool>,
    /// The fold of each.
    folds: Vec<usize>,
    /// The weighted mean of `albedo`, from 0 to 1.
    pub constant: Vec3,
}

/// A fitted texture.
#[derive(Debug, Clone)]
pub struct Texture {
    /// Albedo of each cell.
    pub colors: Vec<Vec3>,
    /// Strength of the smoothing; `None` where one colour did best.
    pub strength: Option<f32>,
    /// The same without the pixels of a fold, for each fold that was left out in turn.
    pub without: Vec<Vec<Vec3>>,
    /// Standard deviation of a pixel of weight 1 that was left out, about the fit, in units of the mean albedo.
    pub noise: Vec3,
}

impl Measurements {
    /// Of pixels and what their cells would send if they were white.
    pub fn new(pixels: &[&SeenPixel], observations: Observations, white: &[Vec3]) -> Self {
        let irradiance: Vec<Vec3> = (observations.all_of(white).iter().zip(pixels))
            .map(|(r, pixel)| *r * pixel.base)
            .collect();
        // A channel whose light hardly reached a pixel's cells says nothing there, and weighs nothing.
        let whites: Vec<f32> = irradiance.iter().map(|r| luminance(*r)).collect();
        let least = Vec3::splat((MIN_LIGHT * mean(&whites)).max(f32::MIN_POSITIVE));
        let irradiance: Vec<Vec3> = (irradiance.iter())
            .map(|r| Vec3::select(r.cmpge(least), *r, Vec3::ZERO))
            .collect();
        let albedo: Vec<Vec3> = (pixels.iter().zip(&irradiance))
            .map(|(pixel, r)| {
                let known = r.cmpgt(Vec3::ZERO);
                Vec3::select(known, (pixel.measured - pixel.gloss) / *r, Vec3::ZERO)
            })
            .collect();
        // Noise grows with the level, down to a floor, in each channel as in its light.
        let floor = Vec3::from_array([0, 1, 2].map(|channel| {
            let mut levels: Vec<f64> = (pixels.iter())
                .map(|p| f64::from(p.measured[channel]))
                .collect();
            DARK * quantile(&mut levels, 0.5).unwrap_or(0.0) as f32
        }));
        let weigh = |constant: Vec3| -> Vec<Vec3> {
            let albedo = luminance(constant);
            let raw: Vec<Vec3> = (irradiance.iter().zip(pixels))
                .map(|(r, pixel)| {
                    let level = *r * albedo + pixel.gloss;
                    let variance = level * level + floor * floor;
                    *r * *r * pixel.weight / variance.max(Vec3::splat(f32::MIN_POSITIVE))
                })
                .collect();
            let scale = 1.0 / mean_channel(&raw).max(f32::MIN_POSITIVE);
            raw.iter().map(|w| *w * scale).collect()
        };
        let squares: Vec<Vec3> = irradiance.iter().map(|r| *r * *r).collect();
        let first = weighted_mean(&albedo, &squares);
        let weights = weigh(weighted_mean(&albedo, &weigh(first)));
        let bounds: Vec<bool> = pixels.iter().map(|p| p.saturated).collect();
        // One colour, below no bound: bounds that it comes to lie above have no say.
        let mut constant = weighted_mean(&albedo, &weights);
        for _ in 0..BOUND_TURNS {
            let rows = albedo.iter().zip(&weights).zip(&bounds);
            let told: Vec<Vec3> = (rows)
                .map(|((a, w), bound)| {
                    if *bound && is_kept(constant, *a, *w) {
                        Vec3::ZERO
                    } else {
                        *w
                    }
                })
                .collect();
            constant = weighted_mean(&albedo, &told);
        }
        Self {
            constant,
            bounds,
            folds: pixels.iter().map(|p| p.fold).collect(),
            observations,
            albedo,
            weights,
        }
    }

    /// Fits the cells, with the smoothing that predicts pixels left out best, in so many folds at least; bounds that the fit
    /// lies above lose their weight.
    pub fn fit(&mut self, links: &Links, min_folds: usize) -> Texture {
        let unit = self.unit();
        let values: Vec<Vec3> = self.albedo.iter().map(|a| *a / unit).collect();
        let flat = vec![self.constant / unit; self.observations.cells()];
        let levels = vec![1.0; flat.len()];
        let density = mean_channel(&self.observations.diagonal(&self.weights));
        let folds = (ENOUGH * FOLDS / self.albedo.len().max(1)).clamp(min_folds, FOLDS);
        let fitted = |weights: &[Vec3], strength: f32, start: &[Vec3]| {
            let problem = Problem {
                observations: &self.observations,
                weights,
                values: &values,
                links,
                levels: &levels,
            };
            fuse(&problem, strength, start)
        };

        // From strong to weak, until it is plainly past the best.
        let mut colors: Vec<Vec<Vec3>> = vec![flat.clone(); folds];
        let clip = self.clip(&values, &flat);
        let mut best = (self.score(&values, &colors, clip), None, colors.clone());
        let mut strength = STRONGEST * density;
        let mut worse = 0;
        while worse < PATIENCE && strength > WEAKEST * density {
            colors
                .par_iter_mut()
                .enumerate()
                .for_each(|(fold, colors)| {
                    *colors = fitted(
                        &self.weights_at(colors, &values, Some(fold)),
                        strength,
                        colors,
                    );
                });
            let score = self.score(&values, &colors, clip);
            if score < best.0 {
                best = (score, Some(strength), colors.clone());
                worse = 0;
            } else {
                worse += 1;
            }
            strength *= FACTOR;
        }

        let (_, strength, without) = best;
        let noise = self.noise(&values, &without);
        let all = match strength {
            Some(strength) => {
                let weights = self.weights_at(&without[0], &values, None);
                fitted(&weights, strength, &without[0])
            }
            None => flat,
        };
        self.weights = self.weights_at(&all, &values, None);
        let albedo = |colors: Vec<Vec3>| -> Vec<Vec3> {
            let colors = colors
                .iter()
                .map(|c| (*c * unit).clamp(Vec3::ZERO, Vec3::ONE));
            colors.collect()
        };
        Texture {
            colors: albedo(all),
            strength,
            without: without.into_iter().map(albedo).collect(),
            noise,
        }
    }

    /// The luminance that albedos are counted in.
    pub fn unit(&self) -> f32 {
        luminance(self.constant).max(MIN_UNIT)
    }

    /// Weights with those of one fold at zero, and of the bounds that some colours lie above.
    fn weights_at(&self, colors: &[Vec3], values: &[Vec3], without: Option<usize>) -> Vec<Vec3> {
        (0..values.len())
            .map(|row| {
                let out = without == Some(self.folds[row]) || !self.tells(row, colors, values);
                if out { Vec3::ZERO } else { self.weights[row] }
            })
            .collect()
    }

    /// Whether a row says something of some colours: a bound does not to those above it.
    fn tells(&self, row: usize, colors: &[Vec3], values: &[Vec3]) -> bool {
        !self.bounds[row]
            || !is_kept(
                self.observations.of(row, colors),
                values[row],
                self.weights[row],
            )
    }

    /// Mean squared residual of the pixels left out, each by the colours that were fitted without it; none of bounds that
    /// these lie above.
    fn score(&self, values: &[Vec3], colors: &[Vec<Vec3>], clip: f64) -> f64 {
        let (mut sum, mut count) = (0.0, 0u64);
        for (row, value) in values.iter().enumerate() {
            if let Some(colors) = colors.get(self.folds[row]) {
                let residual = *value - self.observations.of(row, colors);
                let square = f64::from((residual * residual).dot(self.weights[row]));
                if self.tells(row, colors, values) {
                    sum += square.min(clip);
                }
                count += 1;
            }
        }
        sum / count.max(1) as f64
    }

    /// Root mean square weighted residual of the pixels left out, per channel.
    fn noise(&self, values: &[Vec3], colors: &[Vec<Vec3>]) -> Vec3 {
        let (mut sum, mut count) = (DVec3::ZERO, 0u64);
        for (row, value) in values.iter().enumerate() {
            let colors = colors.get(self.folds[row]);
            if let Some(colors) = colors.filter(|c| self.tells(row, c, values)) {
                let residual = (*value - self.observations.of(row, colors)).as_dvec3();
                sum += residual * residual * self.weights[row].as_dvec3();
                count += 1;
            }
        }
        (sum / count.max(1) as f64).powf(0.5).as_vec3()
    }

    fn clip(&self, values: &[Vec3], flat: &[Vec3]) -> f64 {
        let mut squares: Vec<f64> = (0..values.len())
            .map(|row| {
                let residual = values[row] - self.observations.of(row, flat);
                f64::from((residual * residual).dot(self.weights[row]))
            })
            .collect();
        quantile(&mut squares, 0.5).unwrap_or(0.0) * CLIP
    }
}

/// Whether what a surface of some albedo sends lies above a lower bound, given as an albedo too.
fn is_kept(albedo: Vec3, bound: Vec3, weight: Vec3) -> bool {
    let irradiance = weight.powf(0.5);
    luminance(albedo * irradiance) >= luminance(bound * irradiance)
}

/// The mean of each channel, within 0 and 1; zero where nothing weighs.
fn weighted_mean(values: &[Vec3], weights: &[Vec3]) -> Vec3 {
    let (mut sum, mut total) = (DVec3::ZERO, DVec3::ZERO);
    for (value, weight) in values.iter().zip(weights) {
        let weight = weight.as_dvec3();
        sum += value.as_dvec3() * weight;
        total += weight;
    }
    let mean = DVec3::select(total.cmpgt(DVec3::ZERO), sum / total, DVec3::ZERO);
    mean.as_vec3().clamp(Vec3::ZERO, Vec3::ONE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_that_no_light_reaches_have_no_say_and_leave_all_finite() {
        let pixel = |index: u32| SeenPixel {
            frame: 0,
            pixel: index,
            held_out: false,
            measured: Vec3::splat(0.3),
            saturated: false,
            fold: index as usize % FOLDS,
            weight: 1.0,
            base: 1.0,
            gloss: Vec3::ZERO,
            landings: Vec::new(),
        };
        let pixels: Vec<SeenPixel> = (0..20).map(pixel).collect();
        let seen: Vec<&SeenPixel> = pixels.iter().collect();
        let rows = |cell: fn(u32) -> u32| -> Vec<Vec<(u32, f32)>> {
            (0..20).map(|i| vec![(cell(i), 1.0)]).collect()
        };
        let half_lit = Measurements::new(
            &seen,
            Observations::new(&rows(|i| i % 2), 2),
            &[Vec3::splat(0.6), Vec3::ZERO],
        );
        assert!((half_lit.constant - Vec3::splat(0.5)).length() < 1e-6);
        assert!(half_lit.albedo.iter().all(|a| a.is_finite()));
        let dark = Measurements::new(&seen, Observations::new(&rows(|_| 0), 1), &[Vec3::ZERO]);
        assert_eq!(dark.constant, Vec3::ZERO);
    }

    /// The light of one channel reaches a few pixels only by the noise of paths: what it would make of the others says nothing.
    #[test]
    fn a_channel_without_light_does_not_spoil_the_colour() {
        let truth = Vec3::new(0.2, 0.5, 0.3);
        let white = |cell: usize| Vec3::new(1.0, 0.8, if cell < 90 { 0.4 } else { 1e-8 });
        let pixel = |index: u32| SeenPixel {
            frame: 0,
            pixel: index,
            held_out: false,
            // Some light that no path found comes besides.
            measured: truth * white(index as usize) + 1e-3,
            saturated: index >= 95,
            fold: index as usize % FOLDS,
            weight: 1.0,
            base: 1.0,
            gloss: Vec3::ZERO,
            landings: Vec::new(),
        };
        let pixels: Vec<SeenPixel> = (0..100).map(pixel).collect();
        let seen: Vec<&SeenPixel> = pixels.iter().collect();
        let light: Vec<Vec3> = (0..100).map(white).collect();
        let found = Measurements::new(&seen, Observations::of_each(100), &light);
        assert!(
            (found.constant - truth).length() < 0.01,
            "{}",
            found.constant
        );
        let weight = found.weights[0];
        assert!(found.weights[95].z < 1e-10 && weight.z > 0.0 && weight.x > weight.z);
        // What saturates lies above the bound, however little of one channel arrives.
        let bound = (found.albedo[95], found.weights[95]);
        assert!(is_kept(truth * 1.1, bound.0, bound.1));
    }

    /// Half of a surface whose albedo is known is saturated in other photographs, which changes nothing; of another part all
    /// but a few stray dark pixels are saturated, which keeps it bright.
    #[test]
    fn saturated_pixels_are_lower_bounds() {
        let part = |cell: u32, count: u32, measured: f32, saturated: bool| {
            (0..count).map(move |i| {
                let pixel = SeenPixel {
                    frame: cell,
                    pixel: 2 * i + u32::from(saturated),
                    held_out: false,
                    measured: Vec3::splat(measured),
                    saturated,
                    fold: i as usize % FOLDS,
                    weight: 1.0,
                    base: 1.0,
                    gloss: Vec3::ZERO,
                    landings: Vec::new(),
                };
                (pixel, vec![(cell, 1.0)])
            })
        };
        let (pixels, rows): (Vec<SeenPixel>, Vec<Vec<(u32, f32)>>) = part(0, 40, 0.8, false)
            .chain(part(0, 40, 0.5, true))
            .chain(part(1, 6, 0.05, false))
            .chain(part(1, 34, 0.6, true))
            .unzip();
        let seen: Vec<&SeenPixel> = pixels.iter().collect();
        let links = Links {
            ends: vec![0; 2],
            ..Links::default()
        };
        let mut measurements =
            Measurements::new(&seen, Observations::new(&rows, 2), &[Vec3::ONE; 2]);
        let texture = measurements.fit(&links, 1);
        let [known, stray] = [0, 1].map(|cell: usize| texture.colors[cell].x);
        assert!((known - 0.8).abs() < 1e-3, "{known}");
        assert!((0.45..0.6).contains(&stray), "{stray}");
    }
}
