//! Exposure and white balance of each photograph, where the photographs disagree about surfaces that they share.
//!
//! What a pixel shows is its surface's radiance times its photograph's exposure, one factor a channel. On surface cells
//! that several photographs see, the logarithms are fitted by least absolute differences, so that highlights,
//! mis-registration and people decide nothing. One common factor stays open; by convention the exposures' geometric mean
//! is 1.

use crate::capture::photograph::Photograph;
use crate::inverse::measured::cell_key;
use crate::inverse::solver::Problem;
use crate::inverse::survey::{Survey, SurveyedPixel};
use crate::math::stats::quantile;
use glam::{DVec3, Vec3};
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Width of a surface cell in pixel footprints.
const CELL_FOOTPRINTS: f32 = 4.0;
/// Reweightings of the fit at most, and the change of a logarithm that ends it.
const REWEIGHTINGS: usize = 30;
const STANDING: f64 = 1e-3;
/// Differences of logarithms below this count squared.
const NEAR: f64 = 0.03;
/// Relative weight that keeps what is open near zero.
const OPEN: f64 = 1e-9;
/// Cells that a photograph must share with others, for its exposure to be told.
const LEAST_CELLS: usize = 30;
/// Share of the disagreement on cells left out of the fit that exposures must explain.
const LEAST_GAIN: f64 = 0.05;
/// Pixels darker than this share of the photographs' median level hold mostly noise.
const ABOVE_NOISE: f64 = 0.1;

/// What was found out about exposures.
#[derive(Debug, Clone, PartialEq)]
pub struct Exposures {
    /// For each photograph and channel, its pixels over the radiance.
    pub factors: Vec<Vec3>,
    /// Share of the disagreement, on surfaces left out of the fit, that they explain.
    pub gain: f64,
    /// Whether that is enough for them to be taken.
    pub needed: bool,
}

/// The mean logarithm of what one photograph shows of one surface cell.
#[derive(Debug, Clone, Copy)]
struct Sight {
    frame: usize,
    /// The cell's key, which is a hash.
    cell: u64,
    level: DVec3,
}

/// What the photographs show of the cells, in order of cells.
#[derive(Debug, Default)]
struct Sights {
    fitted: Vec<Sight>,
    /// Of photographs that are kept out of every fit: these are compared with the others, and the others not with them.
    held_out: Vec<Sight>,
}

impl Exposures {
    /// Compares the photographs on the surfaces that they share, held-out pixels left out; `None` where too few are
    /// shared to tell. A photograph that is held out whole is given the exposure at which it fits what the others found, so
    /// that it can test more than that.
    pub fn new(problem: &Problem, survey: &Survey) -> Option<Self> {
        Self::of(&Sights::new(problem, survey), problem.photographs.len())
    }

    fn of(sights: &Sights, photographs: usize) -> Option<Self> {
        let shared = shared(&sights.fitted);
        // Exposures of one half of the cells are tried on the other.
        let (fitted, tested): (Vec<Sight>, Vec<Sight>) =
            shared.iter().partition(|s| s.cell.is_multiple_of(2));
        let half = fit(&fitted, photographs);
        let before = disagreement(&tested, &vec![DVec3::ZERO; photographs])?;
        let after = disagreement(&tested, &half)?;
        let gain = if before > 0.0 {
            1.0 - after / before
        } else {
            0.0
        };
        let mut logarithms = fit(&shared, photographs);
        compare(sights, &mut logarithms);
        Some(Self {
            factors: (logarithms.iter()).map(|l| l.exp().as_vec3()).collect(),
            gain,
            needed: gain > LEAST_GAIN,
        })
    }

    /// The largest and the least factor, of the mean over channels.
    pub fn range(&self) -> (f32, f32) {
        let means = self.factors.iter().map(|f| f.element_sum() / 3.0);
        means.fold((f32::INFINITY, 0.0), |(low, high), m| {
            (low.min(m), high.max(m))
        })
    }

    /// The problem as photographs of equal exposure show it.
    pub fn undone(&self, problem: &Problem) -> Problem {
        let photographs = (problem.photographs.iter().zip(&self.factors))
            .map(|(photograph, factor)| {
                Arc::new(Photograph {
                    pixels: photograph.pixels.iter().map(|p| *p / *factor).collect(),
                    saturation: photograph.saturation / *factor,
                    ..(**photograph).clone()
                })
            })
            .collect();
        Problem {
            photographs,
            ..problem.clone()
        }
    }
}

impl Sights {
    fn new(problem: &Problem, survey: &Survey) -> Self {
        let size = survey.footprint * CELL_FOOTPRINTS;
        if size <= 0.0 {
            return Self::default();
        }
        let mut held_out = vec![true; problem.photographs.len()];
        for pixel in survey.pixels.iter().filter(|p| !p.held_out) {
            held_out[pixel.frame as usize] = false;
        }
        let value = |p: &SurveyedPixel| {
            problem.photographs[p.frame as usize].pixels[p.pixel as usize].as_dvec3()
        };
        let usable = |p: &&SurveyedPixel| {
            let photograph = &problem.photographs[p.frame as usize];
            p.pure
                && p.held_out == held_out[p.frame as usize]
                && !photograph.is_saturated(p.pixel as usize)
        };
        let mut levels: Vec<f64> = (survey.pixels.iter().filter(usable))
            .filter(|p| !p.held_out)
            .map(|p| value(p).max_element())
            .collect();
        let least =
            (quantile(&mut levels, 0.5).unwrap_or(0.0) * ABOVE_NOISE).max(f64::MIN_POSITIVE);

        let mut sums: BTreeMap<(u64, u32), (DVec3, f64)> = BTreeMap::new();
        for pixel in survey.pixels.iter().filter(usable) {
            let value = value(pixel);
            if value.min_element() < least {
                continue;
            }
            if let Some(point) = pixel.points.iter().flatten().next() {
                let key = (cell_key(size, point), pixel.frame);
                let sum = sums.entry(key).or_default();
                sum.0 += value;
                sum.1 += 1.0;
            }
        }
        let sight = |((cell, frame), (sum, count)): ((u64, u32), (DVec3, f64))| Sight {
            frame: frame as usize,
            cell,
            level: (sum / count).map(f64::ln),
        };
        let (held_out, fitted) = (sums.into_iter().map(sight)).partition(|s| held_out[s.frame]);
        Self { fitted, held_out }
    }
}

/// The sights of cells that at least two photographs see.
fn shared(sights: &[Sight]) -> Vec<Sight> {
    let cells = sights.chunk_by(|a, b| a.cell == b.cell);
    (cells.filter(|cell| cell.len() > 1).flatten().copied()).collect()
}

/// Logarithms of the exposures: those with the least sum of absolute differences from the cells' levels, by iteratively
/// reweighted least squares. Zero where too little is shared.
///
/// The cells' levels are eliminated and all photographs solved for at once: found in turns, exposures that drift along a walk
/// through the room, where each photograph shares cells with its neighbours only, would take thousands of them.
fn fit(sights: &[Sight], frames: usize) -> Vec<DVec3> {
    let mut counts = vec![0usize; frames];
    for sight in sights {
        counts[sight.frame] += 1;
    }
    let mut told: Vec<usize> = (0..frames).collect();
    told.retain(|&frame| counts[frame] >= LEAST_CELLS);
    let mut place = vec![None; frames];
    for (row, &frame) in told.iter().enumerate() {
        place[frame] = Some(row);
    }
    let mut exposures = vec![DVec3::ZERO; frames];
    let mut weights = vec![DVec3::ONE; sights.len()];
    for _ in 0..REWEIGHTINGS {
        let solved = [0, 1, 2].map(|channel| {
            let Normal { matrix, right } =
                Normal::new(sights, &weights, &place, told.len(), channel);
            matrix.cholesky().map(|factor| factor.solve(&right))
        });
        let [Some(r), Some(g), Some(b)] = &solved else {
            break;
        };
        let before = exposures.clone();
        for (row, &frame) in told.iter().enumerate() {
            exposures[frame] = DVec3::new(r[row], g[row], b[row]);
        }
        let sum: DVec3 = told.iter().map(|&frame| exposures[frame]).sum();
        for &frame in &told {
            exposures[frame] -= sum / told.len() as f64;
        }
        let mut changes = exposures.iter().zip(&before).map(|(e, b)| (*e - *b).abs());
        if changes.all(|change| change.max_element() < STANDING) {
            break;
        }
        let left = residuals(sights, &weights, &exposures);
        weights = left
            .iter()
            .map(|r| r.abs().max(DVec3::splat(NEAR)).recip())
            .collect();
    }
    exposures
}

/// Sets the exposures of photographs that are held out to the median difference from the cells as the others show them.
fn compare(sights: &Sights, exposures: &mut [DVec3]) {
    let levels = cell_levels(&sights.fitted, exposures);
    let cells = sights.fitted.iter().map(|s| s.cell);
    let level_of: BTreeMap<u64, DVec3> = cells.zip(levels).collect();
    let mut differences: BTreeMap<usize, Vec<DVec3>> = BTreeMap::new();
    for sight in &sights.held_out {
        if let Some(level) = level_of.get(&sight.cell) {
            let of_frame = differences.entry(sight.frame).or_default();
            of_frame.push(sight.level - *level);
        }
    }
    for (frame, of_frame) in differences {
        if of_frame.len() >= LEAST_CELLS {
            exposures[frame] = median(of_frame.into_iter());
        }
    }
}

/// The weighted normal equations of one channel's exposures, without the cells' levels.
struct Normal {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

impl Normal {
    /// `place` tells the row of each photograph; those without one are taken to have the mean exposure.
    fn new(
        sights: &[Sight],
        weights: &[DVec3],
        place: &[Option<usize>],
        rows: usize,
        channel: usize,
    ) -> Self {
        let mut matrix = DMatrix::zeros(rows, rows);
        let mut right = DVector::zeros(rows);
        for (cell, weights) in cells(sights, weights) {
            let total: f64 = weights.iter().map(|w| w[channel]).sum();
            let level = |(sight, w): (&Sight, &DVec3)| sight.level[channel] * w[channel];
            let mean = cell.iter().zip(weights).map(level).sum::<f64>() / total;
            for (a, wa) in cell.iter().zip(weights) {
                let Some(row) = place[a.frame] else { continue };
                matrix[(row, row)] += wa[channel];
                right[row] += wa[channel] * (a.level[channel] - mean);
                for (b, wb) in cell.iter().zip(weights) {
                    if let Some(column) = place[b.frame] {
                        matrix[(row, column)] -= wa[channel] * wb[channel] / total;
                    }
                }
            }
        }
        // What all photographs share, and each group of them that shares nothing with the others, is open.
        for row in 0..rows {
            matrix[(row, row)] *= 1.0 + OPEN;
        }
        Self { matrix, right }
    }
}

/// The sights of one cell after the other, with their weights.
fn cells<'a>(
    sights: &'a [Sight],
    mut weights: &'a [DVec3],
) -> impl Iterator<Item = (&'a [Sight], &'a [DVec3])> {
    sights.chunk_by(|a, b| a.cell == b.cell).map(move |cell| {
        let (own, others) = weights.split_at(cell.len());
        weights = others;
        (cell, own)
    })
}

/// What is left of each sight after its photograph's exposure and the weighted mean level of its cell.
fn residuals(sights: &[Sight], weights: &[DVec3], exposures: &[DVec3]) -> Vec<DVec3> {
    let mut left = Vec::with_capacity(sights.len());
    for (cell, weights) in cells(sights, weights) {
        let (sum, total) = (cell.iter().zip(weights))
            .fold((DVec3::ZERO, DVec3::ZERO), |(sum, total), (s, w)| {
                (sum + *w * (s.level - exposures[s.frame]), total + *w)
            });
        let level = sum / total;
        left.extend(cell.iter().map(|s| s.level - exposures[s.frame] - level));
    }
    left
}

/// For each sight, the median level of its cell under some exposures.
fn cell_levels(sights: &[Sight], exposures: &[DVec3]) -> Vec<DVec3> {
    let mut levels = Vec::with_capacity(sights.len());
    for cell in sights.chunk_by(|a, b| a.cell == b.cell) {
        let level = median(cell.iter().map(|s| s.level - exposures[s.frame]));
        levels.extend(std::iter::repeat_n(level, cell.len()));
    }
    levels
}

/// Mean absolute difference of logarithms between sights and their cells; `None` where nothing is shared.
fn disagreement(sights: &[Sight], exposures: &[DVec3]) -> Option<f64> {
    let cells = cell_levels(sights, exposures);
    let sum: f64 = (sights.iter().zip(&cells))
        .map(|(s, cell)| (s.level - exposures[s.frame] - *cell).abs().element_sum())
        .sum();
    (!sights.is_empty()).then(|| sum / (3.0 * sights.len() as f64))
}

fn median(values: impl Iterator<Item = DVec3>) -> DVec3 {
    let all: Vec<DVec3> = values.collect();
    DVec3::from_array(std::array::from_fn(|channel| {
        let mut values: Vec<f64> = all.iter().map(|v| v[channel]).collect();
        quantile(&mut values, 0.5).unwrap_or(0.0)
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;

    /// Cells of random levels seen by random photographs of given exposures, with some noise and some outliers.
    fn seen(exposures: &[DVec3], noise: f64) -> Vec<Sight> {
        let mut stream = Stream::new(71, 0, 0, 0);
        (0..400)
            .flat_map(|cell| {
                let level = DVec3::splat(f64::from(stream.uniform()) * 3.0);
                let mut own = Vec::new();
                for (frame, exposure) in exposures.iter().enumerate() {
                    if stream.uniform() < 0.5 {
                        let wrong = if stream.uniform() < 0.1 { 1.5 } else { 0.0 };
                        let error = f64::from(stream.uniform() - 0.5) * noise + wrong;
                        own.push(Sight {
                            frame,
                            cell,
                            level: level + *exposure + DVec3::splat(error),
                        });
                    }
                }
                if own.len() > 1 { own } else { Vec::new() }
            })
            .collect()
    }

    #[test]
    fn exposures_are_found_up_to_their_mean_in_spite_of_outliers() {
        let truth: Vec<DVec3> = (0..6)
            .map(|f| DVec3::new(0.1, -0.05, 0.2) * f64::from(f) - DVec3::new(0.25, -0.125, 0.5))
            .collect();
        let found = fit(&seen(&truth, 0.1), 6);
        for (found, truth) in found.iter().zip(&truth) {
            assert!((*found - *truth).length() < 0.03, "{found} {truth}");
        }
    }

    #[test]
    fn a_photograph_that_shares_too_little_keeps_its_exposure() {
        let mut sights = seen(&[DVec3::splat(0.3), DVec3::splat(-0.3)], 0.0);
        sights.push(Sight {
            frame: 2,
            cell: sights.last().map_or(0, |s| s.cell),
            level: DVec3::splat(9.0),
        });
        let found = fit(&sights, 3);
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
        let mut sights = Vec::new();
        for cell in 0..40 * (frames - 1) {
            let level = f64::from(stream.uniform());
            for frame in [cell / 40, cell / 40 + 1] {
                let wrong = if stream.uniform() < 0.05 { 1.0 } else { 0.0 };
                let error = f64::from(stream.uniform() - 0.5) * 0.05 + wrong;
                sights.push(Sight {
                    frame,
                    cell: cell as u64,
                    level: DVec3::splat(level + truth(frame) + error),
                });
            }
        }
        let found = fit(&sights, frames);
        for (frame, found) in found.iter().enumerate() {
            assert!((found.x - truth(frame)).abs() < 0.1, "{frame}: {found}");
        }
    }

    /// Whatever is held out, the exposures of the others are the same bits: here it shares cells with them, and with one of
    /// them cells that no other sees.
    #[test]
    fn a_photograph_held_out_is_compared_with_the_others_and_they_are_not_with_it() {
        let exposures = [0.4, -0.4, 1.3].map(DVec3::splat);
        let (mut held_out, mut fitted): (Vec<Sight>, Vec<Sight>) = seen(&exposures, 0.1)
            .into_iter()
            .partition(|s| s.frame == 2);
        for cell in 1000..1040 {
            let [own, others] = [(3, 1.0), (2, 2.3)].map(|(frame, level)| Sight {
                frame,
                cell,
                level: DVec3::splat(level),
            });
            fitted.push(own);
            held_out.push(others);
        }
        let with = Sights { fitted, held_out };
        let without = Sights {
            fitted: (with.fitted.iter())
                .filter(|s| s.frame < 2)
                .copied()
                .collect(),
            held_out: Vec::new(),
        };
        let [with, without] =
            [with, without].map(|s| Exposures::of(&s, 4).expect("cells are shared"));
        let of_fitted = |e: &Exposures| [e.factors[0], e.factors[1], e.factors[3]];
        assert_eq!(of_fitted(&with), of_fitted(&without));
        assert_eq!((with.gain, with.needed), (without.gain, without.needed));
        let [first, second, _] = of_fitted(&with).map(|f| f.x.ln());
        assert!((first - second - 0.8).abs() < 0.03, "{first} {second}");
        let held_out = with.factors[2].x.ln();
        assert!((held_out - 1.3).abs() < 0.05, "{held_out}");
        assert_eq!(without.factors[2], Vec3::ONE);
    }

    #[test]
    fn equal_exposures_explain_nothing() {
        let sights = seen(&[DVec3::ZERO; 5], 0.2);
        let found = fit(&sights, 5);
        let before = disagreement(&sights, &[DVec3::ZERO; 5]).expect("cells are shared");
        let after = disagreement(&sights, &found).expect("cells are shared");
        assert!((after / before - 1.0).abs() < 0.02, "{before} {after}");
        assert_eq!(disagreement(&[], &[]), None);
    }
}
