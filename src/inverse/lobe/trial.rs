//! Fits the best lobe of an object and cross-validates it against a diffuse surface.

use crate::inverse::lobe::LobeFit;
use crate::inverse::lobe::fit::{Model, Row, Variances, decorrelated};
use crate::inverse::lobe::gather::{Components, Gathered, Gathering};
use crate::inverse::lobe::observations::{Spot, SpotObservation, choose};
use crate::math::stats::{Moments, medians, without_outliers};
use crate::scene::Scene;
use crate::transport::arrival::RayCount;
use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Number of candidate roughnesses, evenly spaced in their logarithm.
const CANDIDATES: usize = 15;
const MIN_ROUGHNESS: f64 = 0.03;
/// Standard deviations that are added to a candidate's error.
const SAFETY: f64 = 2.0;
/// Halvings of the step of the line search between candidates.
const HALVINGS: u32 = 5;
const FOLDS: usize = 4;
/// Fraction of the median level below which weights stop growing.
const DARK: f64 = 0.5;
/// Relative step of finite differences in roughness.
const STEP: f64 = 0.02;

/// Decrease of the squared relative error on data outside the fit.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Gain {
    /// Mean over spots, with clamped outliers.
    pub mean: f64,
    /// Standard error of the mean.
    pub noise: f64,
}

/// An object's observations with their incident radiance.
pub struct LitObservations<'a> {
    /// Index of the spot, observation, and incident radiance from two sets of paths.
    observations: Vec<(usize, &'a SpotObservation, [Gathered; 2])>,
    /// Level of each observation's spot.
    levels: Vec<DVec3>,
}

impl<'a> LitObservations<'a> {
    /// Samples incident radiance at about `max` observations in the fit, and at the held-out ones of the same spots.
    pub fn new(
        gathering: &Gathering,
        scene: &Scene,
        spots: &'a [Spot],
        max: usize,
    ) -> (Self, RayCount) {
        let chosen: Vec<(usize, &SpotObservation)> =
            (choose(spots, 1, max).into_iter().enumerate())
                .flat_map(|(index, spot)| spot.iter().map(move |observation| (index, observation)))
                .collect();
        let (gathered, casts): (Vec<[Gathered; 2]>, Vec<RayCount>) = (chosen.par_iter())
            .map(|(_, observation)| {
                gathering.observation(&scene.cameras[observation.frame as usize], observation)
            })
            .unzip();
        let observations: Vec<_> = (chosen.into_iter().zip(gathered))
            .filter(|(_, light)| !light.iter().any(Gathered::is_empty))
            .map(|((spot, observation), light)| (spot, observation, light))
            .collect();
        let lit = Self {
            levels: levels(&observations),
            observations,
        };
        (lit, casts.into_iter().sum())
    }

    /// The rows in the fit, and the held-out ones, for a lobe of GGX roughness α.
    fn rows(&self, alpha: f64) -> [Vec<Row>; 2] {
        let rows: Vec<(bool, Row)> = (self.observations.par_iter().zip(&self.levels))
            .map(|((spot, observation, light), &level)| {
                let row = Row {
                    spot: *spot,
                    weight: observation.pixels.len() as f64,
                    measured: observation.measured / level,
                    one: level.recip(),
                    sets: [0, 1].map(|set| light[set].components(alpha).map(|c| c / level)),
                };
                (observation.held_out, row)
            })
            .collect();
        [false, true].map(|held_out| {
            let chosen = rows.iter().filter(|r| r.0 == held_out);
            chosen.map(|r| r.1).collect()
        })
    }
}

/// The level of each observation's spot: the root of the squared mean radiance of its observations in the fit plus a squared dark
/// level; the median of all spots stands for the mean if none is in the fit.
fn levels(observations: &[(usize, &SpotObservation, [Gathered; 2])]) -> Vec<DVec3> {
    let spots: Vec<(usize, Option<DVec3>)> = (observations.chunk_by(|a, b| a.0 == b.0))
        .map(|spot| {
            let fitted = || spot.iter().map(|s| s.1).filter(|s| !s.held_out);
            let weight: f64 = fitted().map(|s| s.pixels.len() as f64).sum();
            let sum: DVec3 = fitted().map(|s| s.measured * s.pixels.len() as f64).sum();
            (spot.len(), (weight > 0.0).then(|| sum / weight))
        })
        .collect();
    let median = medians(spots.iter().filter_map(|s| s.1));
    let dark = (median * DARK).max(DVec3::splat(f64::MIN_POSITIVE.sqrt()));
    (spots.into_iter())
        .flat_map(|(count, mean)| {
            let mean = mean.unwrap_or(median);
            std::iter::repeat_n((mean * mean + dark * dark).powf(0.5), count)
        })
        .collect()
}

/// A roughness, and its rows in the fit and the held-out ones.
type Candidate = (f64, [Vec<Row>; 2]);

/// Finds the best lobe with a roughness between the given bounds, and its gain over a diffuse surface, which may emit light if
/// `emits`. `None` if the observations do not determine the models.
pub fn find(observations: &LitObservations, emits: bool, [from, to]: [f64; 2]) -> Option<LobeFit> {
    let diffuse = Model::Diffuse { emits };
    let from = from.clamp(MIN_ROUGHNESS, 1.0);
    let to = to.clamp(from, 1.0);
    let ratio = (to / from).powf(1.0 / (CANDIDATES - 1) as f64);
    let candidates: Vec<Candidate> = (0..CANDIDATES)
        .map(|i| {
            let alpha = (from * ratio.powi(i as i32)).min(to);
            (alpha, observations.rows(alpha))
        })
        .collect();

    // The variances, first by a diffuse surface, then by the best lobe.
    let rows = &candidates[0].1[0];
    let diffuse_variances = diffuse.variances(rows, &diffuse.fit(rows)?);
    let ((_, [rows, _]), parameters) = best(&candidates, &diffuse_variances, |_| true)?;
    let variances = Model::Lobe.variances(rows, &parameters);
    let (&(mut alpha, _), _) = best(&candidates, &variances, |_| true)?;

    // Line search between the candidates.
    let error_at = |alpha: f64| -> Option<(f64, Vec<f64>)> {
        let [rows, _] = observations.rows(alpha);
        let rows = variances.decorrelate(&rows);
        let parameters = Model::Lobe.fit(&rows)?;
        Some((Model::Lobe.error(&rows, &parameters), parameters))
    };
    let mut lowest = error_at(alpha)?;
    let mut step = ratio.sqrt();
    for _ in 0..HALVINGS {
        for next in [alpha * step, alpha / step] {
            let next = next.clamp(from, to);
            if let Some(error) = error_at(next).filter(|e| e.0 < lowest.0) {
                (lowest, alpha) = (error, next);
                break;
            }
        }
        step = step.sqrt();
    }
    let parameters = lowest.1;
    let errors = standard_errors(observations, &variances, alpha, &parameters);

    // Cross-validation.
    let mut gains = Vec::new();
    let mut by_view = Vec::new();
    for fold in 0..FOLDS {
        let inside = |row: &Row| row.spot % FOLDS != fold;
        let Some(((_, [rows, held_out]), lobe)) = best(&candidates, &variances, inside) else {
            continue;
        };
        let select = |rows: &[Row], fitted: bool| -> Vec<Row> {
            (rows.iter().filter(|r| inside(r) == fitted))
                .copied()
                .collect()
        };
        let fitted = diffuse_variances.decorrelate(&select(rows, true));
        let Some(flat) = diffuse.fit(&fitted) else {
            continue;
        };
        let left_out = select(rows, false);
        let compare = |rows: &[Row], into: &mut Vec<f64>| {
            for spot in rows.chunk_by(|a, b| a.spot == b.spot) {
                into.push(diffuse.error(spot, &flat) - Model::Lobe.error(spot, &lobe));
            }
        };
        compare(&diffuse_variances.decorrelate(&left_out), &mut gains);
        let held_out = diffuse_variances.decorrelate(&select(held_out, false));
        compare(&held_out, &mut gains);
        let several: Vec<Row> = (left_out.chunk_by(|a, b| a.spot == b.spot))
            .filter(|spot| spot.len() > 1)
            .flatten()
            .copied()
            .collect();
        compare(&decorrelated(&several, |_| 1.0), &mut by_view);
    }
    let specular = parameters[3];
    let albedo = DVec3::new(parameters[0], parameters[1], parameters[2]) / (1.0 - specular);
    Some(LobeFit {
        roughness: alpha,
        specular,
        albedo,
        errors,
        gain: gain(gains),
        by_view: gain(by_view),
    })
}

/// The candidate with the least error on the rows selected by `inside`, and its parameters. [`SAFETY`] standard deviations are
/// added to errors, since roughnesses far from the sampled ones are noisy.
fn best<'a>(
    candidates: &'a [Candidate],
    variances: &Variances,
    inside: impl Fn(&Row) -> bool + Sync,
) -> Option<(&'a Candidate, Vec<f64>)> {
    let fits: Vec<Option<(f64, &Candidate, Vec<f64>)>> = (candidates.par_iter())
        .map(|candidate| {
            let rows = candidate.1[0].iter().filter(|r| inside(r));
            let rows = variances.decorrelate(&rows.copied().collect::<Vec<_>>());
            let parameters = Model::Lobe.fit(&rows)?;
            let errors: Vec<f64> = (rows.chunk_by(|a, b| a.spot == b.spot))
                .map(|spot| Model::Lobe.error(spot, &parameters))
                .collect();
            let scatter: f64 = errors.iter().map(|e| e * e).sum();
            let error = errors.iter().sum::<f64>() + SAFETY * scatter.sqrt();
            Some((error, candidate, parameters))
        })
        .collect();
    (fits.into_iter().flatten())
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate, parameters)| (candidate, parameters))
}

/// Mean and standard error of spots' gains, with clamped outliers.
fn gain(gains: Vec<f64>) -> Gain {
    let moments: Moments = without_outliers(&gains).into_iter().collect();
    Gain {
        mean: moments.mean,
        noise: moments.standard_error(),
    }
}

/// Standard errors of RGB albedo, specular and roughness: the sandwich estimator over spots (Huber 1967).
fn standard_errors(
    observations: &LitObservations,
    variances: &Variances,
    alpha: f64,
    parameters: &[f64],
) -> [f64; 5] {
    let at = |alpha: f64| variances.decorrelate(&observations.rows(alpha)[0]);
    let (rows, less, more) = (
        at(alpha),
        at(alpha * (1.0 - STEP)),
        at(alpha * (1.0 + STEP)),
    );
    let specular = parameters[3];
    // Derivatives with respect to albedo, specular and roughness.
    let slopes = |i: usize, set: usize, c: usize| -> [(usize, f64); 3] {
        let Components {
            base,
            lobe,
            grazing,
            ..
        } = rows[i].sets[set];
        let albedo = parameters[c] / (1.0 - specular);
        let reflected = |p: &Components| p.lobe[c] * specular + p.grazing[c] * (1.0 - specular);
        let difference = reflected(&more[i].sets[set]) - reflected(&less[i].sets[set]);
        [
            (c, base[c] * (1.0 - specular)),
            (3, lobe[c] - grazing[c] - albedo * base[c]),
            (4, difference / (2.0 * STEP * alpha)),
        ]
    };
    let (mut normal, mut scatter) = (DMatrix::<f64>::zeros(5, 5), DMatrix::<f64>::zeros(5, 5));
    let mut next = 0;
    for spot in rows.chunk_by(|a, b| a.spot == b.spot) {
        let mut score = DVector::<f64>::zeros(5);
        for row in spot {
            let residuals = Model::Lobe.residuals(row, parameters);
            let channels = (0..3).map(|c| (c, [0, 1].map(|set| slopes(next, set, c))));
            for (c, own) in channels {
                for (set, other) in [(0, 1), (1, 0)] {
                    for (i, s) in own[set] {
                        score[i] += 0.5 * row.weight * s * residuals[other][c];
                        for (j, t) in own[other] {
                            normal[(i, j)] += 0.5 * row.weight * s * t;
                        }
                    }
                }
            }
            next += 1;
        }
        scatter += &score * score.transpose();
    }
    match normal.try_inverse() {
        Some(inverse) => {
            let covariance = &inverse * scatter * inverse.transpose();
            std::array::from_fn(|i| covariance[(i, i)].max(0.0).sqrt())
        }
        None => [f64::INFINITY; 5],
    }
}
