//! The lobe that explains an object best, and whether pixels that were left out of its fit ask for it.

use crate::inverse::lobe::Found;
use crate::inverse::lobe::fit::{Model, Row, Variances, freed};
use crate::inverse::lobe::gather::{Gathered, Gathering, Parts};
use crate::inverse::lobe::observations::{Spot, SpotObservation, choose};
use crate::math::stats::{Moments, quantile};
use crate::scene::Scene;
use crate::transport::arrival::Cast;
use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Roughnesses that are tried, evenly spaced in their logarithm, and the least of them.
const TRIED: usize = 15;
const MIN_ROUGHNESS: f64 = 0.03;
/// Standard deviations of an error that count as part of it.
const SURE: f64 = 2.0;
/// Halvings of the step between roughnesses tried.
const HALVINGS: u32 = 5;
/// Parts that spots are cut into, each tried on a fit to the others.
const FOLDS: usize = 4;
/// Below this fraction of the median level errors weigh no more.
const DARK: f64 = 0.5;
/// One spot's gain counts up to so many times what two of three stay below.
const CLIP: f64 = 5.0;
/// Relative step of differences by roughness.
const STEP: f64 = 0.02;

/// Gains on what was left out of the fit, in squared errors relative to the level.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Gain {
    /// Mean over spots, single ones held back from deciding alone.
    pub mean: f64,
    /// Standard error of the mean.
    pub noise: f64,
}

/// Light gathered at an object's observations.
pub struct Evidence<'a> {
    /// Observations with the index of their spot, and the light of each.
    observations: Vec<(usize, &'a SpotObservation, [Gathered; 2])>,
    /// Level of each observation's spot.
    levels: Vec<DVec3>,
}

impl<'a> Evidence<'a> {
    /// Gathers light at up to about `most` observations in the fit, and those held out of the same spots.
    pub fn new(
        gathering: &Gathering,
        scene: &Scene,
        spots: &'a [Spot],
        most: usize,
    ) -> (Self, Cast) {
        let chosen: Vec<(usize, &SpotObservation)> =
            (choose(spots, 1, most).into_iter().enumerate())
                .flat_map(|(index, spot)| spot.iter().map(move |observation| (index, observation)))
                .collect();
        let gathered: Vec<([Gathered; 2], Cast)> = (chosen.par_iter())
            .map(|(_, observation)| {
                gathering.observation(&scene.cameras[observation.frame as usize], observation)
            })
            .collect();
        let cast = gathered.iter().map(|(_, cast)| *cast).sum();
        let mut observations = Vec::new();
        for ((spot, observation), (light, _)) in chosen.into_iter().zip(gathered) {
            if !light.iter().any(Gathered::is_empty) {
                observations.push((spot, observation, light));
            }
        }
        let levels = levels(&observations);
        (
            Self {
                observations,
                levels,
            },
            cast,
        )
    }

    /// The rows in the fit, and those held out, for a lobe of GGX roughness α.
    fn rows(&self, alpha: f64) -> [Vec<Row>; 2] {
        let rows: Vec<(bool, Row)> = (self.observations.par_iter().zip(&self.levels))
            .map(|((spot, observation, light), &level)| {
                let row = Row {
                    spot: *spot,
                    weight: observation.pixels.len() as f64,
                    shown: observation.measured / level,
                    one: level.recip(),
                    sets: [0, 1].map(|set| light[set].parts(alpha) / level),
                };
                (observation.held_out, row)
            })
            .collect();
        let of = |held: bool| (rows.iter().filter(|r| r.0 == held)).map(|r| r.1).collect();
        [of(false), of(true)]
    }
}

/// Of each observation, the mean radiance of its spot's observations in the fit, raised where it is dark; the median of all spots where
/// all its observations are left out of it.
fn levels(observations: &[(usize, &SpotObservation, [Gathered; 2])]) -> Vec<DVec3> {
    let spots: Vec<(usize, Option<DVec3>)> = (observations.chunk_by(|a, b| a.0 == b.0))
        .map(|spot| {
            let fitted = || spot.iter().map(|s| s.1).filter(|s| !s.held_out);
            let weight: f64 = fitted().map(|s| s.pixels.len() as f64).sum();
            let sum: DVec3 = fitted().map(|s| s.measured * s.pixels.len() as f64).sum();
            (spot.len(), (weight > 0.0).then(|| sum / weight))
        })
        .collect();
    let median = DVec3::from_array(std::array::from_fn(|c| {
        let mut values: Vec<f64> = spots.iter().filter_map(|s| Some(s.1?[c])).collect();
        quantile(&mut values, 0.5).unwrap_or(0.0)
    }));
    let dark = (median * DARK).max(DVec3::splat(f64::MIN_POSITIVE.sqrt()));
    (spots.into_iter())
        .flat_map(|(count, mean)| {
            let mean = mean.unwrap_or(median);
            std::iter::repeat_n((mean * mean + dark * dark).powf(0.5), count)
        })
        .collect()
}

/// The rows of one roughness as the fit takes them.
struct Tried {
    alpha: f64,
    rows: Vec<Row>,
    held_out: Vec<Row>,
}

/// Finds the best lobe of roughness between the given bounds; `emits` says that without one the object is taken to give
/// light. `None` where nothing tells.
pub fn find(evidence: &Evidence, emits: bool, [from, to]: [f64; 2]) -> Option<Found> {
    let diffuse = Model::Diffuse { emits };
    let from = from.clamp(MIN_ROUGHNESS, 1.0);
    let to = to.clamp(from, 1.0);
    let ratio = (to / from).powf(1.0 / (TRIED - 1) as f64);
    let tried: Vec<Tried> = (0..TRIED)
        .map(|i| {
            let alpha = (from * ratio.powi(i as i32)).min(to);
            let [rows, held_out] = evidence.rows(alpha);
            Tried {
                alpha,
                rows,
                held_out,
            }
        })
        .collect();

    // How much spots differ, first as a diffuse surface sees it, then as the best lobe does.
    let flat = diffuse.fit(&tried[0].rows)?;
    let before = diffuse.variances(&tried[0].rows, &flat);
    let (first, parameters, _) = best(&tried, &before, |_| true)?;
    let variances = Model::Lobe.variances(&tried[first].rows, &parameters);
    let (place, _, _) = best(&tried, &variances, |_| true)?;

    // Between the roughnesses tried.
    let error_at = |alpha: f64| -> Option<(f64, Vec<f64>)> {
        let [rows, _] = evidence.rows(alpha);
        let freed = variances.free(&rows);
        let parameters = Model::Lobe.fit(&freed)?;
        Some((Model::Lobe.error(&freed, &parameters), parameters))
    };
    let mut alpha = tried[place].alpha;
    let mut least = error_at(alpha)?;
    let mut step = ratio.sqrt();
    for _ in 0..HALVINGS {
        for next in [alpha * step, alpha / step] {
            let next = next.clamp(from, to);
            if let Some(error) = error_at(next).filter(|e| e.0 < least.0) {
                (least, alpha) = (error, next);
                break;
            }
        }
        step = step.sqrt();
    }
    let parameters = least.1;
    let errors = standard_errors(evidence, &variances, alpha, &parameters);

    // What was left out of the fit.
    let mut gains = Vec::new();
    let mut by_view = Vec::new();
    for fold in 0..FOLDS {
        let inside = |row: &Row| row.spot % FOLDS != fold;
        let Some((place, lobe, _)) = best(&tried, &variances, inside) else {
            continue;
        };
        let of = |rows: &[Row], fitted: bool| -> Vec<Row> {
            (rows.iter().filter(|r| inside(r) == fitted))
                .copied()
                .collect()
        };
        let Some(flat) = diffuse.fit(&before.free(&of(&tried[place].rows, true))) else {
            continue;
        };
        let left_out = of(&tried[place].rows, false);
        let compare = |rows: &[Row], into: &mut Vec<f64>| {
            for spot in rows.chunk_by(|a, b| a.spot == b.spot) {
                into.push(diffuse.error(spot, &flat) - Model::Lobe.error(spot, &lobe));
            }
        };
        compare(&before.free(&left_out), &mut gains);
        compare(&before.free(&of(&tried[place].held_out, false)), &mut gains);
        let several: Vec<Row> = (left_out.chunk_by(|a, b| a.spot == b.spot))
            .filter(|spot| spot.len() > 1)
            .flatten()
            .copied()
            .collect();
        compare(&freed(&several, |_| 1.0), &mut by_view);
    }
    let specular = parameters[3];
    let albedo = DVec3::new(parameters[0], parameters[1], parameters[2]) / (1.0 - specular);
    Some(Found {
        roughness: alpha,
        specular,
        albedo,
        errors,
        gain: gain(gains),
        by_view: gain(by_view),
    })
}

/// The roughness tried that surely leaves the least error in the rows that `inside` takes, with its parameters and that
/// error, raised by what it scatters: roughnesses far from those that directions were drawn by are known badly.
fn best(
    tried: &[Tried],
    variances: &Variances,
    inside: impl Fn(&Row) -> bool + Sync,
) -> Option<(usize, Vec<f64>, f64)> {
    let fits: Vec<Option<(usize, Vec<f64>, f64)>> = (tried.par_iter().enumerate())
        .map(|(place, tried)| {
            let rows: Vec<Row> = tried.rows.iter().filter(|r| inside(r)).copied().collect();
            let freed = variances.free(&rows);
            let parameters = Model::Lobe.fit(&freed)?;
            let errors: Vec<f64> = (freed.chunk_by(|a, b| a.spot == b.spot))
                .map(|spot| Model::Lobe.error(spot, &parameters))
                .collect();
            let scatter: f64 = errors.iter().map(|e| e * e).sum();
            let error = errors.iter().sum::<f64>() + SURE * scatter.sqrt();
            Some((place, parameters, error))
        })
        .collect();
    (fits.into_iter().flatten()).min_by(|a, b| a.2.total_cmp(&b.2))
}

fn gain(mut gains: Vec<f64>) -> Gain {
    let mut sizes: Vec<f64> = gains.iter().map(|g| g.abs()).collect();
    let clip = CLIP * quantile(&mut sizes, 0.68).unwrap_or(0.0);
    let mut moments = Moments::default();
    (gains.drain(..)).for_each(|g| moments.push(g.clamp(-clip, clip)));
    Gain {
        mean: moments.mean,
        noise: moments.standard_error(),
    }
}

/// Standard errors of albedo, specular and roughness: the sandwich over spots (Huber 1967).
fn standard_errors(
    evidence: &Evidence,
    variances: &Variances,
    alpha: f64,
    parameters: &[f64],
) -> [f64; 5] {
    let at = |alpha: f64| variances.free(&evidence.rows(alpha)[0]);
    let (rows, less, more) = (
        at(alpha),
        at(alpha * (1.0 - STEP)),
        at(alpha * (1.0 + STEP)),
    );
    let specular = parameters[3];
    // Slopes with respect to albedo, specular and roughness.
    let slopes = |i: usize, set: usize, c: usize| -> [(usize, f64); 3] {
        let parts = &rows[i].sets[set];
        let albedo = parameters[c] / (1.0 - specular);
        let wide = |p: &Parts| p.lobe[c] * specular + p.grazing[c] * (1.0 - specular);
        let of_alpha = (wide(&more[i].sets[set]) - wide(&less[i].sets[set])) / (2.0 * STEP * alpha);
        [
            (c, parts.base[c] * (1.0 - specular)),
            (3, parts.lobe[c] - parts.grazing[c] - albedo * parts.base[c]),
            (4, of_alpha),
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
