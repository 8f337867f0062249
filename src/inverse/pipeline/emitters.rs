//! Which objects give light: tests on traced paths, and how light samples are shared out.

use crate::inverse::emitters::classify::classify;
use crate::inverse::fit::errors::{ScoreTest, score_tests};
use crate::inverse::fit::gauss_newton::Fit;
use crate::inverse::paths::PathCache;
use crate::inverse::pipeline::Pipeline;
use crate::inverse::roles::Role;
use crate::inverse::solver::Termination;
use crate::math::color::luminance;
use crate::transport::emitters::Emitters;
use glam::Vec3;

/// χ² (three channels) above which a light is there, and below which it is not.
pub(super) const SIGNIFICANT: f64 = 25.0;
/// Rounds of changing roles at most.
const MAX_CHANGES: usize = 8;
/// A glow below this fraction of an object's photographed radiance is no light but a shortcoming of the model.
const FAINT: f32 = 0.1;
/// Fraction of the light samples that go to all objects, whatever is known of their light: half by area, half by number, or a bulb
/// that no photograph sees would get none.
const EXPLORATION: f64 = 0.05;

impl Pipeline<'_, '_> {
    /// What the paths say of light from objects that are held dark.
    pub(super) fn test_dark(&mut self, cache: &PathCache) -> Vec<ScoreTest> {
        let objects = self.roles.len();
        let mut free = self.free();
        let active = free.len();
        free.extend(
            (0..objects)
                .filter(|&k| {
                    !self.roles[k].emits() && self.lobes.get(k).is_none_or(Option::is_none)
                })
                .map(|k| objects + k),
        );
        let equations = cache.normal_equations(&self.unknowns, &free, &self.robust, &self.prior);
        let released = score_tests(&equations, &free, active);
        for test in &released {
            self.errors.emission[test.index - objects] =
                Vec3::from_array(test.stderr.map(|e| e as f32));
        }
        self.describe();
        released
    }

    /// Drops the light of unseen objects where nothing speaks for it, least significant first, refitting in between.
    fn prune_unseen(&mut self, cache: &PathCache) -> Result<(), Termination> {
        loop {
            let significance = |k: usize| {
                let z = self.unknowns.emission[k]
                    / self.errors.emission[k].max(Vec3::splat(f32::MIN_POSITIVE));
                f64::from(z.length_squared())
            };
            let mut doubtful: Vec<(f64, usize)> = (0..self.problem.scene.objects.len())
                .filter(|&k| self.roles[k] == Role::Unseen && !self.emission_is_known(k))
                .map(|k| (significance(k), k))
                .filter(|(significance, _)| *significance < SIGNIFICANT)
                .collect();
            if doubtful.is_empty() {
                return Ok(());
            }
            // Lamps that cannot be told from each other are all doubtful: without some of them others may be certain.
            doubtful.sort_by(|a, b| a.0.total_cmp(&b.0));
            for &(_, k) in &doubtful[..doubtful.len().div_ceil(2)] {
                self.roles[k] = Role::Dark;
                self.unknowns.emission[k] = Vec3::ZERO;
            }
            let fitted = self.fit(cache)?;
            self.take(&fitted);
        }
    }

    /// From a fit under the present roles on, lets objects change between reflecting and giving light until the photographs
    /// call for no more of it, refitting in between; then drops the light of unseen objects that nothing speaks for.
    pub(super) fn settle_roles(
        &mut self,
        cache: &PathCache,
        mut fitted: Fit,
    ) -> Result<(), Termination> {
        self.take_values(&fitted);
        let mut returned = vec![false; self.roles.len()];
        for _ in 0..MAX_CHANGES {
            let mut changed = false;
            for change in classify(cache, &self.unknowns, &self.roles) {
                let k = change.object;
                let role = self.allowed(k, change.role);
                // What has gone both ways is left a reflector; what is known, what it is.
                if returned[k] || role == self.roles[k] {
                    continue;
                }
                changed = true;
                self.roles[k] = role;
                if role.emits() {
                    self.unknowns.albedo[k] = Vec3::ZERO;
                    self.unknowns.emission[k] = change.value;
                } else {
                    returned[k] = true;
                    self.unknowns.albedo[k] = change.value;
                    self.unknowns.emission[k] = Vec3::ZERO;
                }
            }
            if !changed {
                break;
            }
            self.hold();
            fitted = self.fit(cache)?;
            self.take_values(&fitted);
        }
        self.take(&fitted);
        self.prune_unseen(cache)
    }

    /// Tests whether any reflector or dark object gives light after all: the one that the paths call for most is set
    /// free, refitted, and kept if it stays significant. Returns their names.
    ///
    /// One that is refused ends the search: next in line is what a texture or a highlight makes look like light.
    pub(super) fn test_glow(&mut self, cache: &PathCache) -> Result<Vec<String>, Termination> {
        let objects = self.roles.len();
        let in_mesh = self.problem.scene.objects.len();
        let mut added = Vec::new();
        while added.len() < MAX_CHANGES {
            let tested = self.test_dark(cache);
            let open = |test: &ScoreTest| {
                let k = test.index - objects;
                k < in_mesh && !self.emission_is_known(k)
            };
            let strongest = (tested.into_iter())
                .filter(open)
                .max_by(|a, b| a.significance().total_cmp(&b.significance()));
            let Some(candidate) = strongest.filter(|c| c.significance() > SIGNIFICANT) else {
                break;
            };
            let k = candidate.index - objects;
            let before = (
                self.unknowns.clone(),
                self.errors.clone(),
                self.roles.clone(),
            );
            self.roles[k] = if self.roles[k] == Role::Dark {
                Role::Unseen
            } else {
                Role::Glowing
            };
            let fitted = self.fit(cache)?;
            self.take(&fitted);
            let z = self.unknowns.emission[k]
                / self.errors.emission[k].max(Vec3::splat(f32::MIN_POSITIVE));
            let faint = self.unknowns.emission[k].max_element() < FAINT * self.brightness[k];
            if f64::from(z.length_squared()) < SIGNIFICANT || faint {
                (self.unknowns, self.errors, self.roles) = before;
                break;
            }
            added.push(self.problem.scene.objects[k].name.clone());
        }
        Ok(added)
    }

    /// Emitters as they are known now, drawn by area × luminance.
    pub(super) fn lights(&self) -> Emitters {
        Emitters::new(&self.problem.scene, &self.light_weights())
    }

    /// Area × luminance of each object, as it is known now.
    pub(super) fn light_weights(&self) -> Vec<f64> {
        (self
            .problem
            .scene
            .objects
            .iter()
            .zip(&self.unknowns.emission))
        .map(|(object, emission)| object.area * f64::from(luminance(*emission)))
        .collect()
    }

    /// Weights with a fraction spread over all objects that have an area.
    pub(super) fn explore(&self, weights: Vec<f64>) -> Vec<f64> {
        let objects = &self.problem.scene.objects;
        let extended: Vec<usize> = (0..objects.len())
            .filter(|&k| objects[k].area > 0.0)
            .collect();
        self.spread(weights, &extended, EXPLORATION)
    }

    /// Weights with this part of their sum added to some objects that have an area: half by area, half by number.
    pub(super) fn spread(&self, mut weights: Vec<f64>, over: &[usize], part: f64) -> Vec<f64> {
        let area = |k: usize| self.problem.scene.objects[k].area;
        let total: f64 = weights.iter().sum();
        let added = if total > 0.0 { total * part } else { 1.0 };
        let all: f64 = over.iter().map(|&k| area(k)).sum();
        for &k in over {
            weights[k] += added * 0.5 * (area(k) / all + 1.0 / over.len() as f64);
        }
        weights
    }
}
