//! Fits the albedo of an object's cells to its pixels, with the smoothing chosen by cross-validation.

use crate::inverse::texture::fuse::{Problem, fuse, mean, mean_channel};
use crate::inverse::texture::links::Links;
use crate::inverse::texture::look::{FOLDS, SeenPixel};
use crate::inverse::texture::observations::Observations;
use crate::math::color::luminance;
use crate::math::stats::quantile;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Number of cross-validated pixels that suffices; with more pixels fewer folds are used.
const ENOUGH: usize = 4_000;
/// The strongest smoothing that is tried, for one pixel per cell.
const STRONGEST: f32 = 2.0;
/// Strength at which a search begins, relative to the one found before: two steps stronger, so that light that was traced anew can
/// ask for more.
const MARGIN: f32 = 4.0;
/// Ratio between consecutive strengths.
const FACTOR: f32 = 0.5;
/// The weakest smoothing that is tried.
const WEAKEST: f32 = 1e-3;
/// Consecutive worse strengths that end the search.
const PATIENCE: u32 = 3;
/// Prior standard deviation of a cell about the object's constant albedo, in units of that albedo's luminance. It matters where
/// pixels say little: in the dark, and where a pixel sees only the edge of a cell.
const PRIOR_DEVIATION: f64 = 2.0;
/// Albedos are relative to the luminance of the object's mean albedo, or to this if it is larger.
const MIN_UNIT: f32 = 1e-4;
/// Fraction of the object's median level below which weights stop growing.
const DARK: f32 = 0.5;
/// Least irradiance of a channel, relative to the mean luminance over the object's pixels.
const MIN_LIGHT: f32 = 1e-6;
/// Iterations over which lower bounds hold at the constant albedo.
const BOUND_ITERATIONS: u32 = 3;
/// Squared residuals are clamped to this multiple of their median.
const CLIP: f64 = 30.0;

/// The pixels of an object that are in the fit, as measurements of its albedo.
#[derive(Debug, Clone)]
pub struct Measurements<'a> {
    /// The cells that each pixel sees.
    pub observations: &'a Observations,
    /// Albedo of each pixel: measured radiance, minus that of a lobe, over that of a white surface.
    pub albedo: Vec<Vec3>,
    /// Weight of each pixel and channel: the squared radiance of a white surface over the pixel's variance, scaled to a mean of
    /// 1; zero for lower bounds that hold.
    pub weights: Vec<Vec3>,
    /// Whether each pixel is saturated, and so a lower bound.
    bounds: Vec<bool>,
    /// The fold of each pixel.
    folds: Vec<usize>,
    /// The best constant albedo, the weighted mean of `albedo`, from 0 to 1.
    pub constant: Vec3,
}

/// A fitted texture.
#[derive(Debug, Clone)]
pub struct Texture {
    /// Albedo of each cell.
    pub colors: Vec<Vec3>,
    /// Strength of the smoothing; `None` if one colour was best.
    pub strength: Option<f32>,
    /// For each fold of the cross-validation, the colours fitted without it.
    pub without: Vec<Vec<Vec3>>,
    /// Standard deviation of cross-validated pixels of weight 1 about the fit, in units of the mean albedo.
    pub noise: Vec3,
    /// Weight of the prior, in the units of the pixels' weights.
    pub prior_weight: f32,
}

impl<'a> Measurements<'a> {
    /// From pixels, and the radiance `white` of each cell with an albedo of one.
    pub fn new(pixels: &[&SeenPixel], observations: &'a Observations, white: &[Vec3]) -> Self {
        let irradiance: Vec<Vec3> = (observations.values(white).iter().zip(pixels))
            .map(|(r, pixel)| *r * pixel.base)
            .collect();
        // Channels with almost no irradiance have no weight.
        let whites: Vec<f32> = irradiance.iter().map(|r| luminance(*r)).collect();
        let min = Vec3::splat((MIN_LIGHT * mean(&whites)).max(f32::MIN_POSITIVE));
        let irradiance: Vec<Vec3> = (irradiance.iter())
            .map(|r| Vec3::select(r.cmpge(min), *r, Vec3::ZERO))
            .collect();
        let albedo: Vec<Vec3> = (pixels.iter().zip(&irradiance))
            .map(|(pixel, r)| {
                let known = r.cmpgt(Vec3::ZERO);
                Vec3::select(known, (pixel.measured - pixel.gloss) / *r, Vec3::ZERO)
            })
            .collect();
        // The noise of a pixel is proportional to its level, down to a floor.
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
        // The constant albedo, without the lower bounds that it meets.
        let mut constant = weighted_mean(&albedo, &weights);
        for _ in 0..BOUND_ITERATIONS {
            let rows = albedo.iter().zip(&weights).zip(&bounds);
            let active: Vec<Vec3> = (rows)
                .map(|((a, w), bound)| match *bound && is_met(constant, *a, *w) {
                    true => Vec3::ZERO,
                    false => *w,
                })
                .collect();
            constant = weighted_mean(&albedo, &active);
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

    /// Fits the cells with the smoothing that predicts cross-validated pixels best, with at least `min_folds` folds. Lower bounds
    /// that the fit meets lose their weight. `known` is the strength that an earlier fit of the same cells chose: the search
    /// begins [`MARGIN`] times as strong. `between` is called after each strength of smoothing, with the root mean square
    /// residual of cross-validated pixels, in units of the mean albedo.
    ///
    /// # Errors
    /// The error of `between`.
    pub fn fit<E>(
        &mut self,
        links: &Links,
        min_folds: usize,
        known: Option<f32>,
        mut between: impl FnMut(f64) -> Result<(), E>,
    ) -> Result<Texture, E> {
        let unit = self.unit();
        let values: Vec<Vec3> = self.albedo.iter().map(|a| *a / unit).collect();
        let flat = vec![self.constant / unit; self.observations.cells()];
        let levels = vec![1.0; flat.len()];
        let density = mean_channel(&self.observations.diagonal(&self.weights));
        let folds = (ENOUGH * FOLDS / self.albedo.len().max(1)).clamp(min_folds, FOLDS);
        let fitted = |weights: &[Vec3], strength, start: &[Vec3], prior_weight| {
            let problem = Problem {
                observations: self.observations,
                weights,
                values: &values,
                links,
                levels: &levels,
                prior: &flat,
                prior_weight,
            };
            fuse(&problem, strength, start)
        };

        // From strong to weak smoothing.
        let mut colors: Vec<Vec<Vec3>> = vec![flat.clone(); folds];
        let clip = self.clip(&values, &flat);
        let mut best = (self.score(&values, &colors, clip), None, colors.clone());
        let strongest = STRONGEST * density;
        let mut strength = known.map_or(strongest, |known| (known * MARGIN).min(strongest));
        let mut worse = 0;
        while worse < PATIENCE && strength > WEAKEST * density {
            let prior_weight = prior_weight(best.0);
            colors
                .par_iter_mut()
                .enumerate()
                .for_each(|(fold, colors)| {
                    *colors = fitted(
                        &self.weights_at(colors, &values, Some(fold)),
                        strength,
                        colors,
                        prior_weight,
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
            between((score / 3.0).sqrt())?;
        }

        let (score, strength, without) = best;
        let prior_weight = prior_weight(score);
        let noise = self.noise(&values, &without);
        let all = match strength {
            Some(strength) => {
                let weights = self.weights_at(&without[0], &values, None);
                fitted(&weights, strength, &without[0], prior_weight)
            }
            None => flat.clone(),
        };
        self.weights = self.weights_at(&all, &values, None);
        let albedo = |colors: Vec<Vec3>| -> Vec<Vec3> {
            let colors = colors
                .iter()
                .map(|c| (*c * unit).clamp(Vec3::ZERO, Vec3::ONE));
            colors.collect()
        };
        Ok(Texture {
            colors: albedo(all),
            strength,
            without: without.into_iter().map(albedo).collect(),
            noise,
            prior_weight,
        })
    }

    /// The luminance that albedos are relative to.
    pub fn unit(&self) -> f32 {
        luminance(self.constant).max(MIN_UNIT)
    }

    /// The weights, with those of one fold and of inactive rows set to zero.
    fn weights_at(&self, colors: &[Vec3], values: &[Vec3], without: Option<usize>) -> Vec<Vec3> {
        (0..values.len())
            .into_par_iter()
            .map(|row| {
                let out = without == Some(self.folds[row]) || !self.is_active(row, colors, values);
                if out { Vec3::ZERO } else { self.weights[row] }
            })
            .collect()
    }

    /// Whether a row constrains the given colours: lower bounds that are met do not.
    fn is_active(&self, row: usize, colors: &[Vec3], values: &[Vec3]) -> bool {
        !self.bounds[row]
            || !is_met(
                self.observations.value(row, colors),
                values[row],
                self.weights[row],
            )
    }

    /// Mean squared residual of the cross-validated pixels, each for the colours fitted without it; zero for lower bounds that are
    /// met.
    fn score(&self, values: &[Vec3], colors: &[Vec<Vec3>], clip: f64) -> f64 {
        let squares: Vec<Option<f64>> = (values.par_iter().enumerate())
            .map(|(row, value)| {
                let colors = colors.get(self.folds[row])?;
                let residual = *value - self.observations.value(row, colors);
                let square = f64::from((residual * residual).dot(self.weights[row]));
                Some(match self.is_active(row, colors, values) {
                    true => square.min(clip),
                    false => 0.0,
                })
            })
            .collect();
        let sum: f64 = squares.iter().flatten().sum();
        sum / squares.iter().flatten().count().max(1) as f64
    }

    /// Root mean square weighted residual of the cross-validated pixels, per channel.
    fn noise(&self, values: &[Vec3], colors: &[Vec<Vec3>]) -> Vec3 {
        let (mut sum, mut count) = (DVec3::ZERO, 0u64);
        for (row, value) in values.iter().enumerate() {
            let colors = colors.get(self.folds[row]);
            if let Some(colors) = colors.filter(|c| self.is_active(row, c, values)) {
                let residual = (*value - self.observations.value(row, colors)).as_dvec3();
                sum += residual * residual * self.weights[row].as_dvec3();
                count += 1;
            }
        }
        (sum / count.max(1) as f64).powf(0.5).as_vec3()
    }

    /// Greatest squared residual that counts: [`CLIP`] times the median for the colours `flat`.
    fn clip(&self, values: &[Vec3], flat: &[Vec3]) -> f64 {
        let mut squares: Vec<f64> = (0..values.len())
            .map(|row| {
                let residual = values[row] - self.observations.value(row, flat);
                f64::from((residual * residual).dot(self.weights[row]))
            })
            .collect();
        quantile(&mut squares, 0.5).unwrap_or(0.0) * CLIP
    }
}

/// Weight of the prior, given the mean squared residual of a pixel over its three channels: the ratio of both variances.
fn prior_weight(score: f64) -> f32 {
    (score / 3.0 / (PRIOR_DEVIATION * PRIOR_DEVIATION)) as f32
}

/// Whether the luminance of a surface is at least a lower bound; both are given as albedos.
fn is_met(albedo: Vec3, bound: Vec3, weight: Vec3) -> bool {
    let irradiance = weight.powf(0.5);
    luminance(albedo * irradiance) >= luminance(bound * irradiance)
}

/// The weighted mean of each channel, clamped to [0, 1]; zero without weight.
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

    fn pixel(index: u32, measured: Vec3, saturated: bool) -> SeenPixel {
        SeenPixel {
            frame: 0,
            pixel: index,
            held_out: false,
            measured,
            saturated,
            fold: index as usize % FOLDS,
            weight: 1.0,
            base: 1.0,
            gloss: Vec3::ZERO,
            hits: Vec::new(),
        }
    }

    #[test]
    fn pixels_that_no_light_reaches_have_no_say_and_leave_all_finite() {
        let pixels: Vec<SeenPixel> = (0..20)
            .map(|index| pixel(index, Vec3::splat(0.3), false))
            .collect();
        let seen: Vec<&SeenPixel> = pixels.iter().collect();
        let rows = |cell: fn(u32) -> u32| -> Vec<Vec<(u32, f32)>> {
            (0..20).map(|i| vec![(cell(i), 1.0)]).collect()
        };
        let halves = Observations::new(&rows(|i| i % 2), 2);
        let half_lit = Measurements::new(&seen, &halves, &[Vec3::splat(0.6), Vec3::ZERO]);
        assert!((half_lit.constant - Vec3::splat(0.5)).length() < 1e-6);
        assert!(half_lit.albedo.iter().all(|a| a.is_finite()));
        let one = Observations::new(&rows(|_| 0), 1);
        let dark = Measurements::new(&seen, &one, &[Vec3::ZERO]);
        assert_eq!(dark.constant, Vec3::ZERO);
    }

    /// A few pixels have almost no irradiance in one channel; dividing by it must not spoil the mean.
    #[test]
    fn a_channel_without_light_does_not_spoil_the_colour() {
        let truth = Vec3::new(0.2, 0.5, 0.3);
        let white = |cell: usize| Vec3::new(1.0, 0.8, if cell < 90 { 0.4 } else { 1e-8 });
        // Plus some light that the paths missed.
        let measured = |index: u32| truth * white(index as usize) + 1e-3;
        let pixels: Vec<SeenPixel> = (0..100)
            .map(|index| pixel(index, measured(index), index >= 95))
            .collect();
        let seen: Vec<&SeenPixel> = pixels.iter().collect();
        let light: Vec<Vec3> = (0..100).map(white).collect();
        let each = Observations::one_per_cell(100);
        let found = Measurements::new(&seen, &each, &light);
        assert!(
            (found.constant - truth).length() < 0.01,
            "{}",
            found.constant
        );
        let weight = found.weights[0];
        assert!(found.weights[95].z < 1e-10 && weight.z > 0.0 && weight.x > weight.z);
        // The lower bound is met in spite of the channel without irradiance.
        let bound = (found.albedo[95], found.weights[95]);
        assert!(is_met(truth * 1.1, bound.0, bound.1));
    }

    /// Saturated pixels below the measured albedo of a cell change nothing. In another cell all but a few dark outliers are
    /// saturated, which keeps it bright.
    #[test]
    fn saturated_pixels_are_lower_bounds() {
        let part = |cell: u32, count: u32, measured: f32, saturated: bool| {
            (0..count).map(move |i| {
                let pixel = pixel(i, Vec3::splat(measured), saturated);
                (pixel, vec![(cell, 1.0)])
            })
        };
        let (pixels, rows): (Vec<SeenPixel>, Vec<Vec<(u32, f32)>>) = part(0, 40, 0.8, false)
            .chain(part(0, 40, 0.5, true))
            .chain(part(1, 6, 0.05, false))
            .chain(part(1, 34, 0.6, true))
            .unzip();
        let colors = colors(&pixels, &rows, 2);
        let [known, stray] = [0, 1].map(|cell: usize| colors[cell].x);
        assert!((known - 0.8).abs() < 1e-3, "{known}");
        assert!((0.45..0.6).contains(&stray), "{stray}");
    }

    /// The fit to pixels that see these fractions of unconnected cells under a light of one.
    fn colors(pixels: &[SeenPixel], rows: &[Vec<(u32, f32)>], cells: usize) -> Vec<Vec3> {
        let seen: Vec<&SeenPixel> = pixels.iter().collect();
        let links = Links {
            ends: vec![0; cells],
            ..Links::default()
        };
        let observations = Observations::new(rows, cells);
        let mut measurements = Measurements::new(&seen, &observations, &vec![Vec3::ONE; cells]);
        let texture = measurements.fit(&links, 1, None, |_| Ok::<_, ()>(()));
        texture.expect("nothing ends it").colors
    }

    /// One pixel sees a hundredth of a cell, and is off by a fifth of its level: without a prior the cell's albedo would be 6.3.
    #[test]
    fn a_cell_that_pixels_hardly_see_stays_near_the_colour_of_the_object() {
        let textured = |i: u32| [0.3, 0.5][(i / 4 % 2) as usize];
        let noise = |i: u32| 0.02 * [1.0, -1.0][(i % 2) as usize];
        let mut pixels: Vec<SeenPixel> = (0..160)
            .map(|i| pixel(i, Vec3::splat(textured(i) + noise(i)), false))
            .collect();
        let mut rows: Vec<Vec<(u32, f32)>> = (0..160).map(|i| vec![(i / 4, 1.0)]).collect();
        pixels.push(pixel(160, Vec3::splat(0.36), false));
        rows.push(vec![(0, 0.99), (40, 0.01)]);
        let colors = colors(&pixels, &rows, 41);
        let [seen, hidden] = [0, 40].map(|cell: usize| colors[cell].x);
        assert!((seen - 0.3).abs() < 0.03, "{seen}");
        assert!((0.3..0.9).contains(&hidden), "{hidden}");
    }
}
