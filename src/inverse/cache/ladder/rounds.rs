//! Rounds of independent paths, added up until the reported errors are small enough or no longer the paths'.

use super::Ladder;
use crate::inverse::cache::accumulate::Accumulated;
use crate::inverse::cache::errors::standard_errors;
use crate::inverse::cache::evaluate::NormalEquations;
use crate::inverse::cache::fit::propose;
use crate::inverse::cache::path_noise::{self, share_paths};
use crate::inverse::cache::roles::{self, Role};
use crate::inverse::cache::trust::Trust;
use crate::inverse::parameters::Unknowns;
use crate::inverse::solver::Termination;

/// A step (in albedo, or relative in emission) asks for linearising anew when it is larger than so many times the
/// median error aimed at.
const NONLINEAR: f64 = 10.0;
/// What the paths add to an error is negligible below this share of it: without them it would be 6 % less.
const NEGLIGIBLE: f64 = 1.0 / 3.0;

impl Ladder<'_, '_> {
    /// Third stage: rounds of independent paths, added up until the reported errors are small enough.
    pub(super) fn rounds(&mut self) -> Result<Termination, Termination> {
        let started = self.monitor.seconds();
        self.monitor.phase("refining");
        share_paths(
            &mut self.clusters,
            self.roles.len(),
            self.budget.round_paths,
        );
        let lights = self.lights();
        let free = roles::free(&self.roles);
        let all: Vec<usize> = (0..free.len()).collect();
        let place = self.places(&free);
        let mut about = self.unknowns.clone();
        let mut sums = Accumulated::default();
        let mut outcome = Termination::Steps;
        for round in 0..self.budget.rounds {
            // Path lengths are steered by what is believed at the start, the same in every round.
            let cache = self.trace(&lights, None, 2, round)?;
            sums.add(cache.linearise(&about, &place));
            let mean = sums.mean();
            self.trust = Trust::from_residuals(&mean, self.roles.len());
            self.path_noise = path_noise::shares(&mean, self.roles.len());
            let equations = NormalEquations::new(&mean, free.len(), &self.trust, &self.prior);
            let (proposal, _) = propose(&equations, &free, &about, 1e-10);
            let errors = standard_errors(&equations, &free, &all, self.roles.len());
            let step = largest_step(&about, &proposal);
            self.monitor.progress.iterations += 1;
            self.unknowns = proposal;
            self.merge_errors(errors);
            self.describe();
            self.monitor
                .report(&self.estimate, &|_| self.checkpoint.clone())?;
            if f64::from(step) > NONLINEAR * self.budget.median_error
                && round < self.budget.rounds / 4
            {
                about = self.unknowns.clone();
                sums = Accumulated::default();
                continue;
            }
            let [median, tail] = self.relative_errors(|k| self.relative_error(k));
            let paths = |k: usize| self.relative_error(k) * self.path_noise[k].sqrt();
            let [median_of_paths, tail_of_paths] = self.relative_errors(paths);
            self.monitor.progress.fraction =
                Some((self.budget.median_error / median).powi(2).min(1.0) as f32);
            // Paths are enough when the error is small, or when next to none of it is theirs.
            let enough = |error: f64, of_paths: f64, target: f64| {
                error < target || of_paths < error * NEGLIGIBLE
            };
            if enough(median, median_of_paths, self.budget.median_error)
                && enough(tail, tail_of_paths, self.budget.tail_error)
            {
                outcome = Termination::Converged;
                break;
            }
        }
        let [median, tail] = self.relative_errors(|k| self.relative_error(k));
        let paths = |k: usize| self.relative_error(k) * self.path_noise[k].sqrt();
        let [median_of_paths, tail_of_paths] = self.relative_errors(paths);
        let why = format!(
            "{} rounds of independent paths: relative standard error of albedo {:.2} % (median), {:.2} % (95 of 100 objects); \
             of that from the paths {:.2} % and {:.2} %, the rest from the photographs and the model",
            sums.rounds(),
            median * 100.0,
            tail * 100.0,
            median_of_paths * 100.0,
            tail_of_paths * 100.0,
        );
        self.finish_stage("refine", started, why)?;
        Ok(outcome)
    }

    /// Where each parameter stands among the free ones.
    fn places(&self, free: &[usize]) -> Vec<usize> {
        let mut place = vec![usize::MAX; 2 * self.roles.len()];
        for (row, &index) in free.iter().enumerate() {
            place[index] = row;
        }
        place
    }

    /// Relative standard error of an albedo.
    fn relative_error(&self, k: usize) -> f64 {
        f64::from(self.errors.albedo[k].length() / self.unknowns.albedo[k].length().max(1e-3))
    }

    /// Median and 95th percentile of an error over the reflectors that enough pixels see.
    fn relative_errors(&self, error: impl Fn(usize) -> f64) -> [f64; 2] {
        let mut errors: Vec<f64> = (0..self.roles.len())
            .filter(|&k| {
                matches!(self.roles[k], Role::Reflector | Role::Glowing)
                    && self.survey.seen.get(k).copied().unwrap_or(0) >= 50
            })
            .map(error)
            .collect();
        [0.5, 0.95].map(|q| crate::math::stats::quantile(&mut errors, q).unwrap_or(0.0))
    }
}

/// Largest change of an albedo, or relative change of an emission.
fn largest_step(from: &Unknowns, to: &Unknowns) -> f32 {
    let albedo = from
        .albedo
        .iter()
        .zip(&to.albedo)
        .map(|(a, b)| (*a - *b).abs().max_element());
    let emission = from.emission.iter().zip(&to.emission).map(|(a, b)| {
        let size = a.max_element();
        if size > 0.0 {
            (*a - *b).abs().max_element() / size
        } else {
            0.0
        }
    });
    albedo.chain(emission).fold(0.0, f32::max)
}
