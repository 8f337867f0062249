//! Exposure and white balance of each photograph, and vignetting and response of all of them, where the photographs disagree
//! about surfaces that they share.
//!
//! What a pixel shows is its surface's radiance times its photograph's exposure, one factor a channel, times what the lens lets
//! through at its distance from the axis, bent by the camera's response. On surface cells that several photographs see, the
//! logarithms are fitted by least absolute differences of values, so that highlights, mis-registration and people decide
//! nothing. One common factor stays open; by convention the exposures' median is 1 in each channel, and the lens dims nothing on
//! its axis. A power of all light stays open too unless the exposures are known: see [`Response`].

mod fit;
mod normal;
mod observations;
mod outlier_frames;
mod undo;

use crate::calibrate::problem::Problem;
use crate::capture::exposure::Vignetting;
use crate::capture::response::Response;
use crate::math::stats::Moments;
use crate::scene::camera::Camera;
use fit::{Parts, compare, disagreements, fit};
use glam::{DVec3, Vec3};
pub use observations::Observations;
use observations::{Observation, shared};
pub use outlier_frames::OutlierFrames;

/// Fraction of the disagreement on cells left out of the fit that exposures must explain, next to vignetting and response where
/// those are found.
const MIN_GAIN: f64 = 0.05;
/// Fraction of what they leave that vignetting, and then the response, must explain, and by how many standard errors.
const MIN_OF_CAMERA: f64 = 0.01;
const SIGNIFICANT: f64 = 4.0;
/// Photographs whose focal lengths, in widths of their pictures, differ by more were not taken through one lens.
const ONE_LENS: f64 = 0.05;

/// What was found out about exposures.
#[derive(Debug, Clone, PartialEq)]
pub struct Exposures {
    /// For each photograph and channel, its pixels over the radiance on the lens's axis; all one where they do not differ.
    pub factors: Vec<Vec3>,
    /// Whether they explain enough of the disagreement.
    pub differ: bool,
    /// How all photographs dim towards their corners, where that explains enough of the rest.
    pub vignetting: Option<Vignetting>,
    /// How the values of all photographs follow the light, where that explains enough of what is left then.
    pub response: Option<Response>,
    /// Fraction of the disagreement, on surfaces left out of the fit, that exposures explain.
    pub gain: f64,
    /// Fraction of what exposures leave of it that vignetting explains.
    pub vignetting_gain: f64,
    /// Fraction of what both leave that the response explains.
    pub response_gain: f64,
}

impl Exposures {
    /// Compares the photographs on the surfaces that they share, held-out pixels left out; `None` where too few are
    /// shared to tell. A photograph that is held out whole is given the exposure at which it fits what the others found, so
    /// that it can test more than that.
    pub fn new(problem: &Problem, observations: &Observations) -> Option<Self> {
        let one_lens = one_lens(&problem.scene.cameras);
        let files_bend = (problem.photographs.iter()).all(|p| p.saturation.is_finite());
        let camera = Shared {
            one_lens,
            may_bend: one_lens && files_bend,
        };
        Self::of(observations, problem.photographs.len(), camera)
    }

    fn of(observations: &Observations, photographs: usize, camera: Shared) -> Option<Self> {
        let shared = shared(&observations.fitted);
        // What is found on one half of the cells is tried on the other.
        let (fitted, tested): (Vec<Observation>, Vec<Observation>) =
            shared.iter().partition(|s| s.cell.is_multiple_of(2));
        if tested.is_empty() {
            return None;
        }
        let with = |exposures, vignetting, response| {
            let parts = Parts {
                exposures,
                vignetting,
                response,
            };
            let found = fit(&fitted, photographs, parts);
            (disagreements(&tested, &found), found)
        };
        let is_needed = |before: &[f64], after: &[f64]| {
            explained(before, after) > MIN_OF_CAMERA && is_significant(before, after)
        };
        let [(exposed, _), (both, found)] =
            [false, true].map(|vignetting| with(true, vignetting, false));
        let vignetting_gain = explained(&exposed, &both);
        let dims = camera.one_lens && found.power.min_element() > 0.0 && is_needed(&exposed, &both);
        let exposed = if dims { both } else { exposed };
        let alone = with(false, dims, false).0;

        // A response beside the exposures, or in their place: known exposures and a power look like others.
        let mut parts = Parts {
            exposures: false,
            vignetting: dims,
            response: false,
        };
        let mut gain = explained(&alone, &exposed);
        let mut response_gain = 0.0;
        if camera.may_bend {
            let [bent, both] = [false, true].map(|exposures| with(exposures, dims, true).0);
            let beside = explained(&bent, &both) > MIN_GAIN;
            let [before, after] = match beside {
                true => [&exposed, &both],
                false => [&alone, &bent],
            };
            response_gain = explained(before, after);
            parts.response = is_needed(before, after);
            if parts.response {
                gain = explained(&bent, &both);
            }
        }
        parts.exposures = gain > MIN_GAIN;

        let mut found = fit(&shared, photographs, parts);
        if parts.exposures {
            compare(observations, &mut found);
        }
        let factor = |logarithm: &DVec3| logarithm.map(f64::exp).as_vec3();
        Some(Self {
            factors: found.exposures.iter().map(factor).collect(),
            differ: parts.exposures,
            vignetting: dims.then(|| Vignetting {
                power: found.power.as_vec3(),
            }),
            response: found.response,
            gain,
            vignetting_gain,
            response_gain,
        })
    }

    /// Whether there is anything to undo.
    pub fn needed(&self) -> bool {
        self.differ || self.vignetting.is_some() || self.response.is_some()
    }

    /// The largest and the least factor, of the mean over channels.
    pub fn range(&self) -> (f32, f32) {
        let means = self.factors.iter().map(|f| f.element_sum() / 3.0);
        means.fold((f32::INFINITY, 0.0), |(low, high), m| {
            (low.min(m), high.max(m))
        })
    }
}

/// What all photographs may have in common.
#[derive(Debug, Clone, Copy)]
struct Shared {
    /// They may have been taken through one lens.
    one_lens: bool,
    /// All of them saturate, so that a camera may have bent them alike.
    may_bend: bool,
}

/// Whether all photographs may have been taken through one lens.
fn one_lens(cameras: &[Camera]) -> bool {
    let lengths = cameras.iter().map(|camera| {
        let k = &camera.intrinsics;
        (k.fx / f64::from(k.width)).abs()
    });
    let (least, most) = lengths.fold((f64::INFINITY, 0.0f64), |(least, most), l| {
        (least.min(l), most.max(l))
    });
    most <= least * (1.0 + ONE_LENS)
}

/// The fraction of a disagreement that goes where another takes its place.
fn explained(before: &[f64], after: &[f64]) -> f64 {
    let [before, after] = [before, after].map(|d| d.iter().sum::<f64>());
    if before > 0.0 {
        1.0 - after / before
    } else {
        0.0
    }
}

/// Whether cells disagree less by more than chance.
fn is_significant(before: &[f64], after: &[f64]) -> bool {
    let mut gains = Moments::default();
    for (before, after) in before.iter().zip(after) {
        gains.push(before - after);
    }
    gains.mean > SIGNIFICANT * gains.standard_error()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;

    const EXPOSURES: Parts = Parts {
        exposures: true,
        vignetting: false,
        response: false,
    };
    const LENS: Shared = Shared {
        one_lens: true,
        may_bend: false,
    };

    fn observation(frame: usize, cell: usize, level: f64) -> Observation {
        Observation {
            frame,
            cell: cell as u64,
            level: DVec3::splat(level),
            off_axis: 0.0,
            full: DVec3::ZERO,
        }
    }

    /// Cells of random levels seen by random photographs of given exposures, anywhere in them, with some noise and some outliers.
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
                            frame,
                            cell,
                            level: level + *exposure + DVec3::splat(error),
                            off_axis: -0.3 * f64::from(stream.uniform()),
                            full: DVec3::ZERO,
                        });
                    }
                }
                if own.len() > 1 { own } else { Vec::new() }
            })
            .collect()
    }

    #[test]
    fn exposures_are_found_up_to_their_median_in_spite_of_outliers() {
        let truth: Vec<DVec3> = (0..6)
            .map(|f| DVec3::new(0.1, -0.05, 0.2) * f64::from(f) - DVec3::new(0.25, -0.125, 0.5))
            .collect();
        let found = fit(&seen(&truth, 0.1), 6, EXPOSURES).exposures;
        for (found, truth) in found.iter().zip(&truth) {
            assert!((*found - *truth).length() < 0.03, "{found} {truth}");
        }
    }

    #[test]
    fn a_photograph_that_shares_too_little_keeps_its_exposure() {
        let mut observations = seen(&[DVec3::splat(0.3), DVec3::splat(-0.3)], 0.0);
        let cell = observations.last().map_or(0, |s| s.cell as usize);
        observations.push(observation(2, cell, 9.0));
        let found = fit(&observations, 3, EXPOSURES).exposures;
        assert_eq!(found[2], DVec3::ZERO);
        assert!((found[0] - found[1] - DVec3::splat(0.6)).length() < 0.01);
    }

    /// A walk of two hundred photographs, each of which shares cells with the next alone: exposures that rise and fall along
    /// it by a factor of twenty are found, outliers among the cells notwithstanding.
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
                observations.push(observation(frame, cell, level + truth(frame) + error));
            }
        }
        let found = fit(&observations, frames, EXPOSURES).exposures;
        for (frame, found) in found.iter().enumerate() {
            assert!((found.x - truth(frame)).abs() < 0.1, "{frame}: {found}");
        }
    }

    /// Whatever is held out, the exposures of the others are the same bits: here it shares cells with them, and with one of
    /// them cells that no other sees.
    #[test]
    fn a_photograph_held_out_is_compared_with_the_others_and_they_are_not_with_it() {
        let exposures = [0.4, -0.4, 1.3].map(DVec3::splat);
        let (mut held_out, mut fitted): (Vec<Observation>, Vec<Observation>) =
            seen(&exposures, 0.1)
                .into_iter()
                .partition(|s| s.frame == 2);
        for cell in 1000..1040 {
            let [own, others] =
                [(3, 1.0), (2, 2.3)].map(|(frame, level)| observation(frame, cell, level));
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
        let [with, without] =
            [with, without].map(|s| Exposures::of(&s, 4, LENS).expect("cells are shared"));
        let of_fitted = |e: &Exposures| [e.factors[0], e.factors[1], e.factors[3]];
        assert_eq!(of_fitted(&with), of_fitted(&without));
        assert_eq!((with.gain, with.differ), (without.gain, without.differ));
        let [first, second, _] = of_fitted(&with).map(|f| f.x.ln());
        assert!((first - second - 0.8).abs() < 0.03, "{first} {second}");
        let held_out = with.factors[2].x.ln();
        assert!((held_out - 1.3).abs() < 0.05, "{held_out}");
        assert_eq!(without.factors[2], Vec3::ONE);
    }

    /// The observations of a lens that dims, those of the last photograph kept out of the fit.
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
        let found = Exposures::of(&observations, 4, LENS).expect("cells are shared");
        assert!(found.differ);
        let vignetting = found.vignetting.expect("a lens that dims");
        let off = vignetting.power.as_dvec3() - power;
        assert!(off.abs().max_element() < 0.1, "{off}");
        // The one held out too, whose observations are dimmed alike.
        for (found, truth) in found.factors.iter().zip(&exposures) {
            let off = found.as_dvec3().map(f64::ln) - *truth;
            assert!(off.abs().max_element() < 0.03, "{off}");
        }
        const DIFFERENT: Shared = Shared {
            one_lens: false,
            may_bend: false,
        };
        let other_lenses = Exposures::of(&observations, 4, DIFFERENT).expect("cells are shared");
        assert_eq!(other_lenses.vignetting, None);
    }

    #[test]
    fn a_lens_that_dims_needs_no_exposures() {
        let observations = dimmed(&[DVec3::ZERO; 4], DVec3::splat(4.0));
        let found = Exposures::of(&observations, 4, LENS).expect("cells are shared");
        assert!(found.vignetting.is_some() && !found.differ && found.needed());
        assert_eq!(found.factors, [Vec3::ONE; 4]);
    }

    #[test]
    fn a_lens_that_brightens_its_corners_is_not_believed() {
        let observations = dimmed(&[DVec3::ZERO; 4], DVec3::splat(-2.0));
        let found = Exposures::of(&observations, 4, LENS).expect("cells are shared");
        assert_eq!(found.vignetting, None);
    }

    const CAMERA: Shared = Shared {
        one_lens: true,
        may_bend: true,
    };

    /// A camera of raised contrast with a shoulder, less of it in one channel.
    fn contrasty() -> Response {
        Response {
            terms: [
                Vec3::new(-0.4, -0.3, -0.2),
                Vec3::ZERO,
                Vec3::new(0.9, 0.7, 0.5),
            ],
        }
    }

    /// What the observations show through a response, of photographs that were divided by the exposures known of them.
    fn bent(
        mut observations: Vec<Observation>,
        response: &Response,
        known: impl Fn(usize) -> f64,
    ) -> Observations {
        for observation in &mut observations {
            observation.full = DVec3::splat(3.4 - known(observation.frame));
            let light = observation.level - observation.full;
            let value = std::array::from_fn(|c| response.log_value(c, light[c]));
            observation.level = DVec3::from_array(value) + observation.full;
        }
        observations
            .retain(|observation| (observation.level - observation.full).max_element() < -0.03);
        Observations {
            fitted: observations,
            held_out: Vec::new(),
        }
    }

    /// The power by which what is found as light grows with the true light, in one channel, and how far it is from that.
    fn power_between(found: &Response, truth: &Response, channel: usize) -> (f64, f64) {
        let lights: Vec<f64> = (0..80).map(|k| -4.0 + 0.05 * f64::from(k)).collect();
        let told = |light: &f64| found.log_light(channel, truth.log_value(channel, *light))[0];
        let [x, y] = [
            lights.clone(),
            lights.iter().map(told).collect::<Vec<f64>>(),
        ];
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
        let found = Exposures::of(&observations, 6, CAMERA).expect("cells are shared");
        assert!(found.differ && found.vignetting.is_none());
        let response = found.response.expect("a response");
        for channel in 0..3 {
            let (power, off) = power_between(&response, &truth, channel);
            assert!(off < 0.05, "{channel}: {off} from a power of {power}");
            // Exposures are of the same power.
            for (found, truth) in found.factors.iter().zip(&exposures) {
                let told = f64::from(found[channel]).ln() - power * (truth[channel] - 0.1);
                assert!(told.abs() < 0.06, "{channel}: {told}");
            }
        }
        // With the files' own curve the light is bent by much more.
        let none = Response {
            terms: [Vec3::ZERO; 3],
        };
        assert!(power_between(&none, &truth, 0).1 > 0.15);
    }

    /// Where exposures are known, as of photographs with an EXIF record, the power is found as well, and no exposures.
    #[test]
    fn known_exposures_tell_the_power_of_a_camera() {
        let known = |frame: usize| [0.9, 0.0, -0.8, 0.4][frame];
        let truth = Response {
            terms: [Vec3::new(-0.25, -0.2, 0.2), Vec3::ZERO, Vec3::ZERO],
        };
        let observations = bent(seen(&[DVec3::ZERO; 4], 0.1), &truth, known);
        let found = Exposures::of(&observations, 4, CAMERA).expect("cells are shared");
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
        let straight = Response {
            terms: [Vec3::ZERO; 3],
        };
        let observations = bent(seen(&exposures, 0.2), &straight, |_| 0.0);
        let found = Exposures::of(&observations, 4, CAMERA).expect("cells are shared");
        assert!(found.differ && found.response.is_none());
        // Nor one whose files are linear, or where no two photographs were taken with one camera.
        let observations = bent(seen(&exposures, 0.1), &contrasty(), |_| 0.0);
        let found = Exposures::of(&observations, 4, LENS).expect("cells are shared");
        assert_eq!(found.response, None);
    }

    #[test]
    fn equal_exposures_explain_nothing() {
        let observations = Observations {
            fitted: seen(&[DVec3::ZERO; 5], 0.2),
            held_out: Vec::new(),
        };
        let found = Exposures::of(&observations, 5, LENS).expect("cells are shared");
        assert!(found.gain.abs() < 0.02, "{}", found.gain);
        assert!(!found.needed());
        assert_eq!(Exposures::of(&Observations::default(), 5, LENS), None);
    }
}
