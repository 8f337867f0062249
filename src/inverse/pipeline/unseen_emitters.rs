//! Lamps that no photograph sees, found by what they do to the room.
//!
//! The light field says what leaves a surface out of sight, and not whether it is its own light or another's that it reflects.
//! Paths that go all the way to a lamp tell: with the right one all albedos fall into place. Each object out of sight is a
//! candidate. Those that a linear step promises most of are tried, each with paths of its own and with all else fitted anew; the
//! one that leaves least of the photographs unexplained is taken, and so on until none makes a difference that is sure.

use crate::inverse::fit::errors::{ScoreTest, score_tests};
use crate::inverse::fit::gauss_newton::Fit;
use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::paths::PathCache;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::pipeline::Pipeline;
use crate::inverse::pipeline::emitters::SIGNIFICANT;
use crate::inverse::roles::Role;
use crate::inverse::solver::Termination;
use crate::inverse::unknowns::Unknowns;
use crate::math::stats::Moments;
use crate::transport::emitters::Emitters;
use glam::Vec3;

/// Lamps out of sight at most.
const MAX_LAMPS: usize = 24;
/// So many candidates are tried at first by either of two tests, and later, when the light is about known, ...
const MAX_TRIED: [usize; 2] = [4, 2];
/// ... of those that promise at least this part of the most.
const PROMISING: f64 = 0.2;
/// A lamp must make residuals smaller by so many standard errors of the mean over all clusters.
const SURE: f64 = 5.0;
/// The search takes this part of the paths of a round, and each that is tried as much again.
const PART: u64 = 4;

/// Light from one more object, with all else fitted to it.
struct Hypothesis {
    cache: PathCache,
    fitted: Fit,
    /// What each cluster's residual is in the end, relative to its level.
    residuals: Vec<f64>,
}

impl Hypothesis {
    /// By how much residuals fall to those of another, if that is sure.
    fn surely_falls_to(&self, other: &Self) -> Option<f64> {
        let mut fall = Moments::default();
        for (before, after) in self.residuals.iter().zip(&other.residuals) {
            fall.push(before - after);
        }
        (fall.mean > SURE * fall.standard_error()).then_some(fall.mean)
    }
}

impl Pipeline<'_, '_> {
    /// Looks for lamps out of sight anew, as if the light field had said nothing of them; what it said stays where that explains
    /// the photographs as well.
    pub(super) fn search_anew(&mut self) -> Result<(), Termination> {
        let by_light_field: Vec<usize> = (0..self.problem.scene.objects.len())
            .filter(|&k| self.roles[k] == Role::Unseen && !self.emission_is_known(k))
            .collect();
        if by_light_field.is_empty() {
            self.search_unseen(true)?;
            return Ok(());
        }
        let before = (self.roles.clone(), self.unknowns.clone());
        let paths = self.budget.round_paths / PART;
        self.monitor.phase("looking for lamps out of sight");
        let said = self.hypothesis(paths)?;
        for &k in &by_light_field {
            self.roles[k] = Role::Dark;
            self.unknowns.emission[k] = Vec3::ZERO;
        }
        let found = self.search_unseen(true)?;
        if !found || said.surely_falls_to(&self.hypothesis(paths)?).is_none() {
            (self.roles, self.unknowns) = before;
        }
        Ok(())
    }

    /// Looks for lamps out of sight, `anew` as long as nothing is known of them; says whether one was found.
    pub(super) fn search_unseen(&mut self, anew: bool) -> Result<bool, Termination> {
        let dark = |k: usize| self.roles[k] == Role::Dark && !self.emission_is_known(k);
        let mut candidates: Vec<usize> = (0..self.problem.scene.objects.len())
            .filter(|&k| dark(k) && self.problem.scene.objects[k].area > 0.0)
            .collect();
        if candidates.is_empty() {
            return Ok(false);
        }
        self.monitor.phase("looking for lamps out of sight");
        let paths = self.budget.round_paths / PART;
        // As many light samples for candidates as for lamps: a bulb would else get none.
        let weights = self.spread(self.light_weights(), &candidates, 1.0);
        let lights = Emitters::new(&self.problem.scene, &weights);
        let (explored, _) = self.stored(&lights, None, 5, paths)?;
        self.robust = RobustWeights::even(self.roles.len());
        let is_dark = self.unknowns.emission.iter().all(|&e| e == Vec3::ZERO);
        let mut found = false;
        for turn in 0..MAX_LAMPS {
            let promising = self.promising(&explored, &candidates, anew && turn == 0);
            if promising.is_empty() {
                break;
            }
            let begun = self.unknowns.clone();
            let now = self.hypothesis(paths)?;
            // A room without any lamp is fitted by absurd albedos; those of the light field are better to begin with.
            self.unknowns = match is_dark && turn == 0 {
                true => begun.clone(),
                false => now.fitted.unknowns.clone(),
            };
            let Some((k, best)) = self.best_of(&promising, &now, paths)? else {
                self.unknowns = begun;
                break;
            };
            found = true;
            candidates.retain(|&c| c != k);
            self.roles[k] = Role::Unseen;
            // What is seen is judged in the new light.
            self.settle_roles(&best.cache, best.fitted)?;
        }
        Ok(found)
    }

    /// Candidates of which a linear step promises most, where light alone follows it, and where albedos do too.
    fn promising(
        &self,
        explored: &PathCache,
        candidates: &[usize],
        at_first: bool,
    ) -> Vec<ScoreTest> {
        let surfaces = self.roles.len();
        let max_tried = MAX_TRIED[usize::from(!at_first)];
        let mut promising: Vec<ScoreTest> = Vec::new();
        let all = self.free();
        let light = all.iter().copied().filter(|&i| i >= surfaces).collect();
        let tests = if at_first {
            vec![light, all]
        } else {
            vec![all]
        };
        for mut free in tests {
            let active = free.len();
            free.extend(candidates.iter().map(|k| surfaces + k));
            let equations =
                explored.normal_equations(&self.unknowns, &free, &self.robust, &self.prior);
            let mut tests: Vec<ScoreTest> = (score_tests(&equations, &free, active).into_iter())
                .filter(|test| test.significance() > SIGNIFICANT)
                .collect();
            tests.sort_by(|a, b| b.gain().total_cmp(&a.gain()).then(a.index.cmp(&b.index)));
            let most = tests.first().map_or(0.0, ScoreTest::gain);
            tests.truncate(max_tried);
            let is_new = |test: &ScoreTest| promising.iter().all(|p| p.index != test.index);
            tests.retain(|test| test.gain() > PROMISING * most && is_new(test));
            promising.extend(tests);
        }
        promising
    }

    /// Tries each of some candidates from the present unknowns on: the one that leaves least, if it surely leaves less than `now`.
    fn best_of(
        &mut self,
        promising: &[ScoreTest],
        now: &Hypothesis,
        paths: u64,
    ) -> Result<Option<(usize, Hypothesis)>, Termination> {
        let surfaces = self.roles.len();
        let before: (Vec<Role>, Unknowns) = (self.roles.clone(), self.unknowns.clone());
        let mut best: Option<(f64, usize, Hypothesis)> = None;
        for test in promising {
            let k = test.index - surfaces;
            self.roles[k] = Role::Unseen;
            self.unknowns.emission[k] = Vec3::from_array(test.step.map(|s| s.max(0.0) as f32));
            let tried = self.hypothesis(paths)?;
            if let Some(fall) = now.surely_falls_to(&tried)
                && best.as_ref().is_none_or(|(most, ..)| fall > *most)
            {
                best = Some((fall, k, tried));
            }
            (self.roles, self.unknowns) = before.clone();
        }
        Ok(best.map(|(_, k, tried)| (k, tried)))
    }

    /// Paths to the present lamps, and all fitted to them.
    fn hypothesis(&mut self, paths: u64) -> Result<Hypothesis, Termination> {
        let lights = self.lights();
        let (cache, _) = self.stored(&lights, None, 6, paths)?;
        let fitted = self.fit(&cache)?;
        let left = cache.residuals(&fitted.unknowns);
        let size = |cluster: &Linearised| {
            let weight = cluster.weight_now();
            (weight.powf(0.5) * cluster.residual().abs()).element_sum()
        };
        Ok(Hypothesis {
            residuals: left.iter().map(size).collect(),
            cache,
            fitted,
        })
    }
}
