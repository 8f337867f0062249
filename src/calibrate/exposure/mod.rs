//! Estimates the exposure and white balance of each photograph, and the vignetting and response that all share, from surfaces
//! that several photographs see.
//!
//! A pixel's value is the response of radiance × exposure (one factor per channel) × vignetting. The logarithms are fitted on
//! surface cells by least absolute deviations, which are robust to highlights, misregistration and people. A common factor is
//! undetermined: by convention the median exposure is 1 in each channel, and vignetting is 1 on the optical axis. A power of all
//! radiances is undetermined too unless the exposures are known: see [`Response`].

mod fit;
mod normal;
mod observations;
mod outlier_frames;

use crate::calibrate::problem::Problem;
use crate::capture::exposure::{Exposure, Vignetting};
use crate::capture::photograph::{BELOW_SATURATION, Photograph};
use crate::capture::response::Response;
use crate::math::stats::Moments;
use crate::scene::camera::Camera;
use fit::{ModelParts, disagreements, fit, fit_held_out};
use glam::{DVec3, Vec3};
pub use observations::Observations;
use observations::{Observation, shared};
pub use outlier_frames::OutlierFrames;
use rayon::prelude::*;
use std::sync::Arc;

/// Least fraction of the disagreement between photographs, on cells held out of the fit, that exposures must explain; and of what
/// remains, that the response must. JPEG's rounding of dark values looks like a response: in photographs without one it explained
/// 3 % (`relit demo --family phone --seed 2`) and 1 % (`--family scanned --seed 2`).
const MIN_GAIN: f64 = 0.05;
/// Least fraction of the remaining disagreement that vignetting must explain.
const MIN_VIGNETTING_GAIN: f64 = 0.01;
/// Least gain of vignetting and response in standard errors over cells.
const SIGNIFICANT: f64 = 4.0;
/// Largest relative difference of focal lengths, in image widths, of photographs through one lens.
const ONE_LENS: f64 = 0.05;

/// The estimated exposures, vignetting and response. Each part is used only if it explains enough of the disagreement.
#[derive(Debug, Clone, PartialEq)]
pub struct Exposures {
    /// For each photograph and channel, light on the sensor over radiance on the optical axis; all one unless `differ`.
    pub factors: Vec<Vec3>,
    /// Whether exposures explain enough of the disagreement.
    pub differ: bool,
    /// Vignetting of all photographs.
    pub vignetting: Option<Vignetting>,
    /// Response of all photographs.
    pub response: Option<Response>,
    /// Fraction of the disagreement, on cells held out of the fit, that exposures explain.
    pub gain: f64,
    /// Fraction of the disagreement after exposures that vignetting explains.
    pub vignetting_gain: f64,
    /// Fraction of the disagreement after both that the response explains.
    pub response_gain: f64,
}

impl Exposures {
    /// Fits the photographs on the cells that they share, without held-out pixels; `None` if too few cells are shared. A
    /// photograph that is held out whole gets the exposure that fits it best to the others' cells, so that it can still test
    /// the rest of the estimate.
    pub fn new(problem: &Problem, observations: &Observations) -> Option<Self> {
        let one_lens = one_lens(&problem.scene.cameras);
        let all_saturate = (problem.photographs.iter()).all(|p| p.saturation.is_finite());
        let camera = match (one_lens, all_saturate) {
            (false, _) => Common::Nothing,
            (true, false) => Common::Lens,
            (true, true) => Common::Camera,
        };
        Self::estimate(observations, problem.photographs.len(), camera)
    }

    fn estimate(observations: &Observations, photographs: usize, camera: Common) -> Option<Self> {
        let shared = shared(&observations.fitted);
        // Models fitted to one half of the cells are tested on the other half.
        let (fitted, tested): (Vec<Observation>, Vec<Observation>) =
            shared.iter().partition(|s| s.cell.is_multiple_of(2));
        if tested.is_empty() {
            return None;
        }
        let test = |exposures, vignetting, response| {
            let parts = ModelParts {
                exposures,
                vignetting,
                response,
            };
            let model = fit(&fitted, photographs, parts);
            (disagreements(&tested, &model), model)
        };
        let [(without, _), (with, model)] =
            [false, true].map(|vignetting| test(true, vignetting, false));
        let vignetting_gain = explained(&without, &with);
        let vignetting = camera >= Common::Lens
            && model.power.min_element() > 0.0
            && is_needed(&without, &with, MIN_VIGNETTING_GAIN);
        let exposed = if vignetting { with } else { without };
        let unexposed = test(false, vignetting, false).0;

        // The response is tested together with exposures or instead of them: a power of known exposures looks like other exposures.
        let mut parts = ModelParts {
            exposures: false,
            vignetting,
            response: false,
        };
        let mut gain = explained(&unexposed, &exposed);
        let mut response_gain = 0.0;
        if camera == Common::Camera {
            let [response_only, both] =
                [false, true].map(|exposures| test(exposures, vignetting, true).0);
            let [before, after] = match explained(&response_only, &both) > MIN_GAIN {
                true => [&exposed, &both],
                false => [&unexposed, &response_only],
            };
            response_gain = explained(before, after);
            parts.response = is_needed(before, after, MIN_GAIN);
            if parts.response {
                gain = explained(&response_only, &both);
            }
        }
        parts.exposures = gain > MIN_GAIN;

        let mut model = fit(&shared, photographs, parts);
        if parts.exposures {
            fit_held_out(observations, &mut model);
        }
        let factor = |logarithm: &DVec3| logarithm.map(f64::exp).as_vec3();
        Some(Self {
            factors: model.exposures.iter().map(factor).collect(),
            differ: parts.exposures,
            vignetting: vignetting.then(|| Vignetting {
                power: model.power.as_vec3(),
            }),
            response: model.response,
            gain,
            vignetting_gain,
            response_gain,
        })
    }

    /// Whether there is anything to correct.
    pub fn needed(&self) -> bool {
        self.differ || self.vignetting.is_some() || self.response.is_some()
    }

    /// The problem with photographs of equal exposure and white balance, without vignetting, and linear in radiance.
    pub fn corrected(&self, problem: &Problem) -> Problem {
        let cameras = &problem.scene.cameras;
        let photographs = (problem.photographs.par_iter().zip(cameras))
            .zip(&self.factors)
            .map(|((photograph, camera), factor)| {
                let exposure = Exposure {
                    factor: *factor,
                    vignetting: self.vignetting,
                    response: self.response,
                };
                let saturation = photograph.saturation;
                let light = |value: Vec3| exposure.light(value, saturation);
                // A value counts as saturated afterwards if and only if it did before.
                let limit = |limit: Vec3| {
                    light(limit).min(light(limit * BELOW_SATURATION) / BELOW_SATURATION)
                };
                let size = [photograph.width, photograph.height];
                let factors: Vec<Vec3> = (0..photograph.pixels.len())
                    .map(|pixel| exposure.at(&camera.intrinsics, size, pixel))
                    .collect();
                let limit_varies = self.vignetting.is_some() && photograph.saturation.is_finite();
                let limits = match limit_varies || !photograph.limits.is_empty() {
                    true => (factors.iter().enumerate())
                        .map(|(pixel, factor)| limit(photograph.limit(pixel)) / *factor)
                        .collect(),
                    false => Vec::new(),
                };
                let pixels = photograph.pixels.iter().zip(&factors);
                Arc::new(Photograph {
                    pixels: pixels
                        .map(|(value, factor)| light(*value) / *factor)
                        .collect(),
                    saturation: limit(saturation) / *factor,
                    limits,
                    usable: photograph.usable.clone(),
                    ..**photograph
                })
            })
            .collect();
        Problem {
            photographs,
            ..problem.clone()
        }
    }

    /// The smallest and the largest factor, averaged over channels.
    pub fn range(&self) -> (f32, f32) {
        let means = self.factors.iter().map(|f| f.element_sum() / 3.0);
        means.fold((f32::INFINITY, 0.0), |(low, high), m| {
            (low.min(m), high.max(m))
        })
    }
}

/// What photographs may have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Common {
    Nothing,
    /// One lens, and with it vignetting.
    Lens,
    /// Also the camera's response: all photographs saturate, so they are not linear renderings.
    Camera,
}

/// Whether the focal lengths allow that all photographs were taken through one lens.
fn one_lens(cameras: &[Camera]) -> bool {
    let lengths = cameras.iter().map(|camera| {
        let k = &camera.intrinsics;
        (k.fx / f64::from(k.width)).abs()
    });
    let (min, max) = lengths.fold((f64::INFINITY, 0.0f64), |(min, max), l| {
        (min.min(l), max.max(l))
    });
    max <= min * (1.0 + ONE_LENS)
}

/// Relative decrease of the summed disagreement.
fn explained(before: &[f64], after: &[f64]) -> f64 {
    let [before, after] = [before, after].map(|d| d.iter().sum::<f64>());
    match before > 0.0 {
        true => 1.0 - after / before,
        false => 0.0,
    }
}

/// Whether the disagreement decreases by more than a fraction, and its mean per cell by more than chance.
fn is_needed(before: &[f64], after: &[f64], fraction: f64) -> bool {
    let gains: Moments = before.iter().zip(after).map(|(b, a)| b - a).collect();
    let is_significant = gains.mean > SIGNIFICANT * gains.standard_error();
    is_significant && explained(before, after) > fraction
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;

    /// Observations of cells of random levels by random photographs of given log exposures, with noise and 10 % outliers.
    fn seen(exposures: &[DVec3], noise: f64) -> Vec<Observation> {
        let mut stream = Stream::new(71, 0, 0, 0);
        (0..400)
            .flat_map(|cell| {
                let level = DVec3::splat(f64::from(stream.uniform()) * 3.0);
                let mut own = Vec::new();
                for (frame, exposure) in exposures.iter().enumerate() {
                    if stream.uniform() < 0.5 {
                        let wrong = if stream.uniform() < 0.1 { 1.5 } else { 0.0 };
                        let error = f64::from(stream.uniform() - 0.5) * noise + wrong;
                        own.push(Observation {
                            level: level + *exposure + DVec3::splat(error),
                            off_axis: -0.3 * f64::from(stream.uniform()),
                            ..Observation::grey(frame, cell, 0.0)
                        });
                    }
                }
                if own.len() > 1 { own } else { Vec::new() }
            })
            .collect()
    }

    fn estimate(observations: &Observations, frames: usize, camera: Common) -> Exposures {
        Exposures::estimate(observations, frames, camera).expect("cells are shared")
    }

    #[test]
    fn a_photograph_that_shares_too_little_keeps_its_exposure() {
        let mut observations = seen(&[DVec3::splat(0.3), DVec3::splat(-0.3)], 0.0);
        let cell = observations.last().map_or(0, |s| s.cell as usize);
        observations.push(Observation::grey(2, cell, 9.0));
        let found = fit(&observations, 3, ModelParts::EXPOSURES).exposures;
        assert_eq!(found[2], DVec3::ZERO);
        assert!((found[0] - found[1] - DVec3::splat(0.6)).length() < 0.01);
    }

    /// A walk of 200 photographs that each share cells with the next alone, with exposures of 1 to 20 and 5 % of outliers.
    #[test]
    fn exposures_that_drift_along_a_walk_are_found() {
        let frames = 200;
        let truth = |f: usize| (f as f64 / frames as f64 * std::f64::consts::TAU).sin() * 1.5;
        let mut stream = Stream::new(72, 0, 0, 0);
        let mut observations = Vec::new();
        for cell in 0..40 * (frames - 1) {
            let level = f64::from(stream.uniform());
            for frame in [cell / 40, cell / 40 + 1] {
                let wrong = if stream.uniform() < 0.05 { 1.0 } else { 0.0 };
                let error = f64::from(stream.uniform() - 0.5) * 0.05 + wrong;
                observations.push(Observation::grey(frame, cell, level + truth(frame) + error));
            }
        }
        let found = fit(&observations, frames, ModelParts::EXPOSURES).exposures;
        for (frame, found) in found.iter().enumerate() {
            assert!((found.x - truth(frame)).abs() < 0.1, "{frame}: {found}");
        }
    }

    /// The exposures of fitted photographs are the same bits with and without a held-out one. It shares cells with all of them,
    /// and with one of them cells that no other sees.
    #[test]
    fn a_photograph_held_out_is_compared_with_the_others_and_they_are_not_with_it() {
        let exposures = [0.4, -0.4, 1.3].map(DVec3::splat);
        let (mut held_out, mut fitted): (Vec<Observation>, Vec<Observation>) =
            seen(&exposures, 0.1)
                .into_iter()
                .partition(|s| s.frame == 2);
        for cell in 1000..1040 {
            let [own, others] =
                [(3, 1.0), (2, 2.3)].map(|(frame, level)| Observation::grey(frame, cell, level));
            fitted.push(own);
            held_out.push(others);
        }
        let with = Observations { fitted, held_out };
        let without = Observations {
            fitted: (with.fitted.iter())
                .filter(|s| s.frame < 2)
                .copied()
                .collect(),
            held_out: Vec::new(),
        };
        let [with, without] = [with, without].map(|s| estimate(&s, 4, Common::Lens));
        let of_fitted = |e: &Exposures| [e.factors[0], e.factors[1], e.factors[3]];
        assert_eq!(of_fitted(&with), of_fitted(&without));
        assert_eq!((with.gain, with.differ), (without.gain, without.differ));
        let [first, second, _] = of_fitted(&with).map(|f| f.x.ln());
        assert!((first - second - 0.8).abs() < 0.03, "{first} {second}");
        let held_out = with.factors[2].x.ln();
        assert!((held_out - 1.3).abs() < 0.05, "{held_out}");
        assert_eq!(without.factors[2], Vec3::ONE);
    }

    /// Observations with vignetting; the last photograph is held out.
    fn dimmed(exposures: &[DVec3], power: DVec3) -> Observations {
        let mut all = seen(exposures, 0.1);
        for observation in &mut all {
            observation.level += power * observation.off_axis;
        }
        let (held_out, fitted) =
            (all.into_iter()).partition(|observation| observation.frame == exposures.len() - 1);
        Observations { fitted, held_out }
    }

    #[test]
    fn a_lens_that_dims_its_corners_is_told_from_exposures() {
        let exposures = [0.5, 0.0, -0.4, 0.9].map(DVec3::splat);
        let power = DVec3::new(1.0, 2.0, 4.0);
        let observations = dimmed(&exposures, power);
        let found = estimate(&observations, 4, Common::Lens);
        assert!(found.differ);
        let vignetting = found.vignetting.expect("a lens that dims");
        let off = vignetting.power.as_dvec3() - power;
        assert!(off.abs().max_element() < 0.1, "{off}");
        // The held-out photograph has the same vignetting.
        for (found, truth) in found.factors.iter().zip(&exposures) {
            let off = found.as_dvec3().map(f64::ln) - *truth;
            assert!(off.abs().max_element() < 0.03, "{off}");
        }
        let other_lenses = estimate(&observations, 4, Common::Nothing);
        assert_eq!(other_lenses.vignetting, None);
    }

    #[test]
    fn a_lens_that_dims_needs_no_exposures() {
        let observations = dimmed(&[DVec3::ZERO; 4], DVec3::splat(4.0));
        let found = estimate(&observations, 4, Common::Lens);
        assert!(found.vignetting.is_some() && !found.differ && found.needed());
        assert_eq!(found.factors, [Vec3::ONE; 4]);
    }

    #[test]
    fn a_lens_that_brightens_its_corners_is_refused() {
        let observations = dimmed(&[DVec3::ZERO; 4], DVec3::splat(-2.0));
        let found = estimate(&observations, 4, Common::Lens);
        assert_eq!(found.vignetting, None);
    }

    /// A response of raised contrast with a shoulder, different in each channel.
    fn contrasty() -> Response {
        Response {
            terms: [
                Vec3::new(-0.4, -0.3, -0.2),
                Vec3::ZERO,
                Vec3::new(0.9, 0.7, 0.5),
            ],
        }
    }

    /// Applies a response to observations. The photographs were divided by `known` log exposures.
    fn bent(
        mut observations: Vec<Observation>,
        response: &Response,
        known: impl Fn(usize) -> f64,
    ) -> Observations {
        for observation in &mut observations {
            observation.saturation = DVec3::splat(3.4 - known(observation.frame));
            let light = observation.level - observation.saturation;
            let value = std::array::from_fn(|c| response.log_value(c, light[c]));
            observation.level = DVec3::from_array(value) + observation.saturation;
        }
        observations.retain(|observation| {
            (observation.level - observation.saturation).max_element() < -0.03
        });
        Observations {
            fitted: observations,
            held_out: Vec::new(),
        }
    }

    /// Fits a power law between the light of `found` and of `truth` in one channel: the power and the largest deviation.
    fn power_between(found: &Response, truth: &Response, channel: usize) -> (f64, f64) {
        let x: Vec<f64> = (0..80).map(|k| -4.0 + 0.05 * f64::from(k)).collect();
        let recovered = |light: &f64| found.log_light(channel, truth.log_value(channel, *light))[0];
        let y: Vec<f64> = x.iter().map(recovered).collect();
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        let (mx, my) = (mean(&x), mean(&y));
        let both: f64 = x.iter().zip(&y).map(|(x, y)| (x - mx) * (y - my)).sum();
        let power = both / x.iter().map(|x| (x - mx) * (x - mx)).sum::<f64>();
        let off = (x.iter().zip(&y)).map(|(x, y)| (y - my - power * (x - mx)).abs());
        (power, off.fold(0.0, f64::max))
    }

    #[test]
    fn a_camera_that_bends_values_is_found_up_to_a_power() {
        let exposures = [0.7, 0.2, 0.0, -0.5, -0.9, 0.4].map(DVec3::splat);
        let truth = contrasty();
        let observations = bent(seen(&exposures, 0.1), &truth, |_| 0.0);
        let found = estimate(&observations, 6, Common::Camera);
        assert!(found.differ && found.vignetting.is_none());
        let response = found.response.expect("a response");
        for channel in 0..3 {
            let (power, off) = power_between(&response, &truth, channel);
            assert!(off < 0.05, "{channel}: {off} from a power of {power}");
            // Exposures are of the same power.
            for (found, truth) in found.factors.iter().zip(&exposures) {
                let error = f64::from(found[channel]).ln() - power * (truth[channel] - 0.1);
                assert!(error.abs() < 0.06, "{channel}: {error}");
            }
        }
        // The identity deviates much more.
        let none = Response::default();
        assert!(power_between(&none, &truth, 0).1 > 0.15);
    }

    /// If exposures are known, as from EXIF, the power is determined too, and no exposures are fitted.
    #[test]
    fn known_exposures_tell_the_power_of_a_camera() {
        let known = |frame: usize| [0.9, 0.0, -0.8, 0.4][frame];
        let truth = Response {
            terms: [Vec3::new(-0.25, -0.2, 0.2), Vec3::ZERO, Vec3::ZERO],
        };
        let observations = bent(seen(&[DVec3::ZERO; 4], 0.1), &truth, known);
        let found = estimate(&observations, 4, Common::Camera);
        assert!(!found.differ && found.needed(), "{}", found.gain);
        let response = found.response.expect("a response");
        for channel in 0..3 {
            let (power, off) = power_between(&response, &truth, channel);
            assert!((power - 1.0).abs() < 0.03 && off < 0.05, "{power} {off}");
        }
    }

    #[test]
    fn a_camera_that_bends_nothing_is_given_no_response() {
        let exposures = [0.7, 0.2, -0.5, -0.9].map(DVec3::splat);
        let straight = Response::default();
        let observations = bent(seen(&exposures, 0.2), &straight, |_| 0.0);
        let found = estimate(&observations, 4, Common::Camera);
        assert!(found.differ && found.response.is_none());
        let of_nothing = Exposures::estimate(&Observations::default(), 4, Common::Lens);
        assert_eq!(of_nothing, None);
        // Without a shared response, as of linear files, none is fitted.
        let observations = bent(seen(&exposures, 0.1), &contrasty(), |_| 0.0);
        let found = estimate(&observations, 4, Common::Lens);
        assert_eq!(found.response, None);
    }
}
