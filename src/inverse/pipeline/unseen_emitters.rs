//! Finds lamps that no photograph sees, by their effect on the room.
//!
//! The light field determines the exitant radiance of an unseen surface, but not whether it is emitted or reflected. Full paths
//! do: only the right lamps explain the photographs with consistent albedos. All unseen objects are candidates. Everything is refitted
//! with each of those with the best score tests, on paths of its own: first on a few, then, for those with the smallest residuals,
//! on more. The one with the smallest residuals is accepted, and the search is repeated until no candidate reduces the residuals
//! significantly.

use crate::inverse::fit::errors::ScoreTest;
use crate::inverse::fit::gauss_newton::Fit;
use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::paths::PathCache;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::pipeline::emitters::SIGNIFICANT;
use crate::inverse::pipeline::{Pipeline, Result};
use crate::inverse::roles::Role;
use crate::inverse::unknowns::Unknowns;
use crate::math::stats::Moments;
use crate::transport::emitters::Emitters;
use glam::{DVec3, Vec3};

const MAX_LAMPS: usize = 24;
/// Greatest number of candidates of a score test that are fitted to a few paths. A score test ranks large surfaces before small
/// lamps: it is linear, and its paths are shared by all candidates, so that few of them meet a small one. In the room of `relit demo
/// --family clutter --seed 3` the lamp was the fourth to seventh, by the seed of the solve.
const MAX_ROUGH: usize = 8;
/// Greatest number of candidates that are fitted to all paths of a trial: in the first iteration, and later.
const MAX_TRIALS: [usize; 2] = [4, 2];
/// Least gain of a candidate, relative to the best one.
const PROMISING: f64 = 0.2;
/// Least decrease of the mean residual over clusters, in standard errors.
const MIN_DECREASE: f64 = 5.0;
/// Limit of a cluster's residual: twenty times that of noise alone, which is 2.4 over three channels. One path that meets a lamp by
/// chance would outweigh all other clusters.
const MAX_RESIDUAL: f64 = 50.0;
/// Paths of a round over the paths of the search, and of each trial.
const PATHS_DIVISOR: u64 = 4;
/// Paths of a trial over those of a rough one.
const ROUGH_DIVISOR: u64 = 4;
/// Fraction of the light from unseen lamps below which `preview` does not ask which surfaces give it: the error that the light
/// field's albedos are taken to have anyway.
const MIN_SHARE: f64 = 0.01;

/// A set of lamps with everything fitted to it.
struct Hypothesis {
    cache: PathCache,
    fitted: Fit,
    /// Absolute residual of each cluster, relative to its level.
    residuals: Vec<f64>,
}

impl Hypothesis {
    /// Decrease of the mean residual from this hypothesis to another one, if it is significant.
    fn decrease_to(&self, other: &Self) -> Option<f64> {
        let pairs = self.residuals.iter().zip(&other.residuals);
        let decrease: Moments = pairs.map(|(before, after)| before - after).collect();
        (decrease.mean > MIN_DECREASE * decrease.standard_error()).then_some(decrease.mean)
    }
}

impl Pipeline<'_, '_> {
    /// Unseen lamps whose emission is not known.
    pub(super) fn unseen_lamps(&self) -> Vec<usize> {
        (0..self.problem.scene.objects.len())
            .filter(|&k| self.roles[k] == Role::Unseen && !self.emission_is_known(k))
            .collect()
    }

    /// Whether unseen lamps give more than [`MIN_SHARE`] of the light.
    pub(super) fn is_lit_out_of_sight(&self) -> bool {
        let weights = self.light_weights();
        let unseen: f64 = self.unseen_lamps().into_iter().map(|k| weights[k]).sum();
        unseen > MIN_SHARE * weights.iter().sum::<f64>()
    }

    /// Number of paths of the search, and of each trial.
    fn search_paths(&self) -> u64 {
        self.budget.round_paths / PATHS_DIVISOR
    }

    /// Searches for unseen lamps anew. Those of the light field are kept unless the new ones are significantly better.
    pub(super) fn search_anew(&mut self) -> Result {
        let by_light_field = self.unseen_lamps();
        if by_light_field.is_empty() {
            self.search_unseen(true)?;
            return Ok(());
        }
        let before = (self.roles.clone(), self.unknowns.clone());
        let paths = self.search_paths();
        self.monitor.phase("looking for lamps out of sight");
        let light_field = self.hypothesis(paths)?;
        for &k in &by_light_field {
            self.roles[k] = Role::Dark;
            self.unknowns.emission[k] = Vec3::ZERO;
        }
        let found = self.search_unseen(true)?;
        if !found || light_field.decrease_to(&self.hypothesis(paths)?).is_none() {
            (self.roles, self.unknowns) = before;
        }
        Ok(())
    }

    /// Searches for more unseen lamps; `anew` if none is known yet. Returns whether one was found.
    pub(super) fn search_unseen(&mut self, anew: bool) -> Result<bool> {
        let dark = |k: usize| self.roles[k] == Role::Dark && !self.emission_is_known(k);
        let mut candidates: Vec<usize> = (0..self.problem.scene.objects.len())
            .filter(|&k| dark(k) && self.problem.scene.objects[k].area > 0.0)
            .collect();
        if candidates.is_empty() {
            return Ok(false);
        }
        self.monitor.phase("looking for lamps out of sight");
        let paths = self.search_paths();
        // Half of the light samples are spread over the candidates.
        let weights = self.spread(self.light_weights(), &candidates, 1.0);
        let lights = Emitters::new(&self.problem.scene, &weights);
        let (explored, _) = self.stored(&lights, None, 5, paths)?;
        self.robust = RobustWeights::even(self.roles.len());
        let mut found = false;
        for iteration in 0..MAX_LAMPS {
            let promising = self.promising(&explored, &candidates, anew && iteration == 0)?;
            if promising.is_empty() {
                break;
            }
            let present = self.hypothesis(paths)?;
            // Each trial starts where the search stands. Without the lamp, the fit to full paths may have absurd albedos.
            let Some((k, best)) = self.best_of(&promising, &present)? else {
                break;
            };
            found = true;
            candidates.retain(|&c| c != k);
            self.roles[k] = Role::Unseen;
            // Classify the seen objects with the new lamp.
            self.settle_roles(&best.cache, best.fitted)?;
        }
        Ok(found)
    }

    /// The candidates with the smallest residuals after a fit to a few paths, of those with the best score tests: with all
    /// parameters active, and at first also with emissions alone.
    fn promising(
        &mut self,
        explored: &PathCache,
        candidates: &[usize],
        at_first: bool,
    ) -> Result<Vec<ScoreTest>> {
        let surfaces = self.roles.len();
        let mut promising: Vec<ScoreTest> = Vec::new();
        let all = self.free();
        let light: Vec<usize> = all.iter().copied().filter(|&i| i >= surfaces).collect();
        for mut free in at_first.then_some(light).into_iter().chain([all]) {
            let active = free.len();
            free.extend(candidates.iter().map(|k| surfaces + k));
            let mut tests: Vec<ScoreTest> = (self.score_tests(explored, &free, active).into_iter())
                .filter(|test| test.significance() > SIGNIFICANT)
                .collect();
            tests.sort_by(|a, b| b.gain().total_cmp(&a.gain()).then(a.index.cmp(&b.index)));
            let max_gain = tests.first().map_or(0.0, ScoreTest::gain);
            tests.truncate(MAX_ROUGH);
            let is_new = |test: &ScoreTest| promising.iter().all(|p| p.index != test.index);
            tests.retain(|test| test.gain() > PROMISING * max_gain && is_new(test));
            promising.extend(tests);
        }
        let trials = MAX_TRIALS[usize::from(!at_first)];
        if promising.len() <= trials {
            return Ok(promising);
        }
        let paths = self.search_paths() / ROUGH_DIVISOR;
        let mut fitted = Vec::new();
        for test in promising {
            let rough = self.with_lamp(&test, |this| this.hypothesis(paths))?;
            fitted.push((rough.residuals.iter().sum::<f64>(), test));
        }
        fitted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.index.cmp(&b.1.index)));
        fitted.truncate(trials);
        Ok(fitted.into_iter().map(|(_, test)| test).collect())
    }

    /// Does something with a candidate as a lamp, then goes back to the state before.
    fn with_lamp<T>(
        &mut self,
        candidate: &ScoreTest,
        with: impl FnOnce(&mut Self) -> Result<T>,
    ) -> Result<T> {
        let k = candidate.index - self.roles.len();
        let before: (Vec<Role>, Unknowns) = (self.roles.clone(), self.unknowns.clone());
        self.roles[k] = Role::Unseen;
        self.unknowns.emission[k] = candidate.step.max(DVec3::ZERO).as_vec3();
        let result = with(self);
        (self.roles, self.unknowns) = before;
        result
    }

    /// Fits each candidate from the present unknowns; returns the one with the largest significant decrease of the residuals
    /// relative to `present`.
    fn best_of(
        &mut self,
        promising: &[ScoreTest],
        present: &Hypothesis,
    ) -> Result<Option<(usize, Hypothesis)>> {
        let paths = self.search_paths();
        let mut best: Option<(f64, usize, Hypothesis)> = None;
        for test in promising {
            let tried = self.with_lamp(test, |pipeline| pipeline.hypothesis(paths))?;
            if let Some(decrease) = present.decrease_to(&tried)
                && best.as_ref().is_none_or(|(max, ..)| decrease > *max)
            {
                best = Some((decrease, test.index - self.roles.len(), tried));
            }
        }
        Ok(best.map(|(_, k, tried)| (k, tried)))
    }

    /// Traces full paths with the present lamps, and fits everything to them.
    fn hypothesis(&mut self, paths: u64) -> Result<Hypothesis> {
        let lights = self.lights();
        let (cache, _) = self.stored(&lights, None, 6, paths)?;
        let fitted = self.fit(&cache)?;
        Ok(Hypothesis {
            residuals: residuals(&cache, &fitted.unknowns),
            cache,
            fitted,
        })
    }
}

/// Absolute residual of each cluster, relative to its level, up to [`MAX_RESIDUAL`].
fn residuals(cache: &PathCache, unknowns: &Unknowns) -> Vec<f64> {
    let size = |cluster: Linearised| {
        let weight = cluster.weight_now();
        let sum = (weight.powf(0.5) * cluster.residual().abs()).element_sum();
        sum.min(MAX_RESIDUAL)
    };
    cache.residuals(unknowns).into_iter().map(size).collect()
}
