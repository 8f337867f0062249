//! Finds outlier frames: photographs that contradict the others, because of a wrong pose or of another room.

use crate::calibrate::exposure::fit::{CameraModel, MIN_CELLS, ModelParts, fit, fit_held_out};
use crate::calibrate::exposure::observations::{Observation, Observations, shared};
use crate::calibrate::problem::Problem;
use crate::math::stats::quantile;
use glam::DVec3;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Least number of compared photographs for which the median difference is meaningful.
const MIN_PHOTOGRAPHS: usize = 4;
/// Least difference of an outlier frame, as a multiple of the median difference.
const TIMES_MEDIAN: f64 = 4.0;
/// Least difference of an outlier frame, in log radiance. Noise, gloss and blur cause less.
const MIN_DIFFERENCE: f64 = 0.3;

/// How well photographs agree about the surfaces that they share.
#[derive(Debug, Clone, PartialEq)]
pub struct OutlierFrames {
    /// Median over photographs of their difference: the median absolute difference in log radiance, over shared cells, from the
    /// median of the other photographs, at the fitted exposures.
    pub usual: f64,
    /// Frame index and difference of each outlier.
    pub outliers: BTreeMap<usize, f64>,
}

impl OutlierFrames {
    /// Finds outlier frames and removes their observations; `None` if too few photographs share enough cells. The worst frame is
    /// removed first and the others compared again, since its neighbours may differ from it alone. Held-out photographs are
    /// compared with the fitted ones only.
    pub fn new(observations: &mut Observations, photographs: usize) -> Option<Self> {
        let mut outliers = BTreeMap::new();
        let cells = shared(&observations.fitted);
        let mut fitted = fit(&cells, photographs, ModelParts::EXPOSURES);
        let mut current = differences(&cells, &fitted);
        let max_outliers = current.len().div_ceil(2).saturating_sub(1);
        let mut usual = median(&current)?;
        loop {
            let worst = current.iter().max_by(|a, b| a.1.total_cmp(b.1));
            let Some((&frame, &difference)) =
                worst.filter(|(_, d)| is_outlier(**d, usual) && outliers.len() < max_outliers)
            else {
                break;
            };
            outliers.insert(frame, difference);
            observations.remove(frame);
            // The exposures are fitted robustly, so they need not be fitted again after each outlier.
            current = differences(&shared(&observations.fitted), &fitted);
            usual = median(&current).unwrap_or(usual);
        }
        if !outliers.is_empty() {
            let cells = shared(&observations.fitted);
            fitted = fit(&cells, photographs, ModelParts::EXPOSURES);
        }
        for (frame, residuals) in fit_held_out(observations, &mut fitted) {
            let mut sizes: Vec<f64> = (residuals.iter())
                .map(|d| d.abs().element_sum() / 3.0)
                .collect();
            if let Some(difference) = quantile(&mut sizes, 0.5).filter(|&d| is_outlier(d, usual)) {
                outliers.insert(frame, difference);
                observations.remove(frame);
            }
        }
        Some(Self { usual, outliers })
    }

    /// The problem with all pixels of the outlier frames masked.
    pub fn without_outliers(&self, problem: &Problem) -> Problem {
        let mut problem = problem.clone();
        for &frame in self.outliers.keys() {
            problem.photographs[frame] = Arc::new(problem.photographs[frame].masked());
        }
        problem
    }

    /// One sentence per outlier frame.
    pub fn remarks(&self) -> Vec<String> {
        let fraction = |difference: f64| (difference.exp() - 1.0) * 100.0;
        let remark = |(frame, difference): (&usize, &f64)| {
            format!(
                "frame {frame} (counted from 0) is left out: half of what it shares with others differs by {:.0} % or more, where \
                 {:.0} % is usual; its pose may be wrong",
                fraction(*difference),
                fraction(self.usual)
            )
        };
        self.outliers.iter().map(remark).collect()
    }
}

fn is_outlier(difference: f64, usual: f64) -> bool {
    difference > (usual * TIMES_MEDIAN).max(MIN_DIFFERENCE)
}

/// For each photograph that shares enough cells, its median absolute difference in log radiance from the other photographs.
fn differences(shared: &[Observation], fitted: &CameraModel) -> BTreeMap<usize, f64> {
    let mut all: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for cell in shared.chunk_by(|a, b| a.cell == b.cell) {
        let levels: Vec<DVec3> = (cell.iter())
            .map(|observation| observation.level - fitted.exposures[observation.frame])
            .collect();
        for (observation, difference) in cell.iter().zip(from_others(&levels)) {
            all.entry(observation.frame).or_default().push(difference);
        }
    }
    (all.into_iter())
        .filter(|(_, all)| all.len() >= MIN_CELLS)
        .filter_map(|(frame, mut all)| Some((frame, quantile(&mut all, 0.5)?)))
        .collect()
}

/// The median over photographs; `None` if there are too few.
fn median(differences: &BTreeMap<usize, f64>) -> Option<f64> {
    let mut all: Vec<f64> = differences.values().copied().collect();
    let enough = all.len() >= MIN_PHOTOGRAPHS;
    enough.then(|| quantile(&mut all, 0.5))?
}

/// For each of a cell's levels, the absolute difference from the median of the others, averaged over the channels.
fn from_others(levels: &[DVec3]) -> Vec<f64> {
    let mut sum = vec![0.0; levels.len()];
    for channel in 0..3 {
        let mut order: Vec<usize> = (0..levels.len()).collect();
        order.sort_by(|&a, &b| levels[a][channel].total_cmp(&levels[b][channel]));
        for (rank, &own) in order.iter().enumerate() {
            // The sorted levels without this one.
            let rest = |i: usize| levels[order[i + usize::from(i >= rank)]][channel];
            let count = levels.len() - 1;
            let median = 0.5 * (rest((count - 1) / 2) + rest(count / 2));
            sum[own] += (levels[own][channel] - median).abs() / 3.0;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;

    /// Random numbers from −1 to 1.
    fn numbers() -> impl FnMut() -> f64 {
        let mut stream = Stream::new(73, 0, 0, 0);
        move || f64::from(stream.uniform()) * 2.0 - 1.0
    }

    /// Observations of cells of random levels by photographs of random exposures, with noise of 0.1; `sees` selects the
    /// photographs of each cell. Frames in `wrong` show unrelated levels.
    fn seen(
        cells: usize,
        frames: usize,
        wrong: &[usize],
        sees: impl Fn(usize, usize) -> bool,
    ) -> Vec<Observation> {
        let mut draw = numbers();
        let exposures: Vec<f64> = (0..frames).map(|_| draw()).collect();
        let mut observations = Vec::new();
        for cell in 0..cells {
            let level = draw();
            for (frame, exposure) in exposures.iter().enumerate().filter(|f| sees(cell, f.0)) {
                let radiance = match wrong.contains(&frame) {
                    true => draw(),
                    false => level + 0.1 * draw(),
                };
                observations.push(Observation::grey(frame, cell, radiance + exposure));
            }
        }
        observations
    }

    fn outliers(
        fitted: Vec<Observation>,
        held_out: Vec<Observation>,
        frames: usize,
    ) -> Option<Vec<usize>> {
        let mut observations = Observations { fitted, held_out };
        let found = OutlierFrames::new(&mut observations, frames)?;
        assert_eq!(found.remarks().len(), found.outliers.len());
        let mut left = observations.fitted.iter().chain(&observations.held_out);
        assert!(left.all(|s| !found.outliers.contains_key(&s.frame)));
        Some(found.outliers.into_keys().collect())
    }

    #[test]
    fn photographs_of_something_else_are_found_whatever_the_exposures() {
        for wrong in [&[][..], &[3], &[0, 5]] {
            let observations = seen(400, 8, wrong, |cell, frame| (cell >> frame) % 2 == 0);
            let found = outliers(observations, Vec::new(), 8);
            assert_eq!(found.as_deref(), Some(wrong));
        }
    }

    /// A walk on which each photograph shares cells with the next one alone: neighbours of the wrong one differ from it only.
    #[test]
    fn neighbours_of_a_wrong_photograph_stay() {
        let observations = seen(40 * 11, 12, &[5], |cell, frame| {
            (cell / 40..cell / 40 + 2).contains(&frame)
        });
        assert_eq!(outliers(observations, Vec::new(), 12), Some(vec![5]));
    }

    #[test]
    fn photographs_held_out_are_judged_by_the_others() {
        let observations = seen(400, 8, &[2], |_, _| true);
        let held_out = |frame: usize| frame == 2 || frame == 6;
        let (held_out, fitted) = observations.into_iter().partition(|s| held_out(s.frame));
        assert_eq!(outliers(fitted, held_out, 8), Some(vec![2]));
    }

    #[test]
    fn three_photographs_are_too_few_to_tell_which_is_wrong() {
        let observations = seen(400, 3, &[1], |_, _| true);
        assert_eq!(outliers(observations, Vec::new(), 3), None);
    }

    #[test]
    fn a_level_is_compared_with_the_median_of_the_others() {
        let levels = [5.0, 1.0, 2.0, 4.0].map(DVec3::splat);
        // Medians of 1 2 4, of 2 4 5, of 1 4 5 and of 1 2 5.
        assert_eq!(from_others(&levels), [3.0, 3.0, 2.0, 2.0]);
        assert_eq!(from_others(&levels[..2]), [4.0, 4.0]);
    }
}
