//! Settles which objects emit light, by tests on stored paths, and sets the weights of light sampling.

use crate::inverse::emitters::classify::{Change, classify};
use crate::inverse::fit::errors::ScoreTest;
use crate::inverse::fit::gauss_newton::Fit;
use crate::inverse::known::Known;
use crate::inverse::paths::PathCache;
use crate::inverse::pipeline::fitting::role_under;
use crate::inverse::pipeline::{Pipeline, Result};
use crate::inverse::roles::Role;
use crate::transport::emitters::{Emitters, powers};
use glam::Vec3;

/// χ² (three channels) above which an emission is significant.
pub(super) const SIGNIFICANT: f64 = 25.0;
/// Greatest number of rounds of role changes.
const MAX_CHANGES: usize = 40;
/// Greatest number of objects that are given an emission beside their albedo.
const MAX_GLOWING: usize = 8;
/// An emission below this fraction of an object's photographed radiance is attributed to model error.
const FAINT: f32 = 0.1;
/// Fraction of the light samples that are spread over all objects: half by area, half by number, so that small bulbs get some.
const EXPLORATION: f64 = 0.05;

impl Pipeline<'_, '_> {
    /// Score tests of emission from objects that are held dark.
    pub(super) fn test_dark(&mut self, cache: &PathCache) -> Vec<ScoreTest> {
        let objects = self.roles.len();
        let mut free = self.free();
        let active = free.len();
        free.extend(
            (0..objects)
                .filter(|&k| {
                    let is_dark = !self.roles[k].emits() && self.roles[k] != Role::Saturated;
                    is_dark && self.lobes.get(k).is_none_or(Option::is_none)
                })
                .map(|k| objects + k),
        );
        let tests = self.score_tests(cache, &free, active);
        for test in &tests {
            self.errors.emission[test.index - objects] = test.stderr.as_vec3();
        }
        self.describe();
        tests
    }

    /// χ² of an object's emission.
    fn significance(&self, k: usize) -> f64 {
        let z =
            self.unknowns.emission[k] / self.errors.emission[k].max(Vec3::splat(f32::MIN_POSITIVE));
        f64::from(z.length_squared())
    }

    /// Removes insignificant emission of unseen objects, the least significant half at a time, with a refit after each.
    fn prune_unseen(&mut self, cache: &PathCache) -> Result {
        loop {
            let mut doubtful: Vec<(f64, usize)> = (self.unseen_lamps().into_iter())
                .map(|k| (self.significance(k), k))
                .filter(|(significance, _)| *significance < SIGNIFICANT)
                .collect();
            if doubtful.is_empty() {
                return Ok(());
            }
            // Indistinguishable lamps are all insignificant; without some of them the others may be significant.
            doubtful.sort_by(|a, b| a.0.total_cmp(&b.0));
            for &(_, k) in &doubtful[..doubtful.len().div_ceil(2)] {
                self.roles[k] = Role::Dark;
                self.unknowns.emission[k] = Vec3::ZERO;
            }
            let fitted = self.fit(cache)?;
            self.take(&fitted);
        }
    }

    /// Starting from a fit with the present roles, changes the roles of objects and refits until the classification is stable; then
    /// removes insignificant emission of unseen objects.
    pub(super) fn settle_roles(&mut self, cache: &PathCache, mut fitted: Fit) -> Result {
        self.take_values(&fitted);
        let scanned = self.problem.scene.scanned;
        let mut was_emitter = vec![false; self.roles.len()];
        for _ in 0..MAX_CHANGES {
            let mut changes = classify(cache, &self.unknowns, &self.roles, scanned);
            // An object that became a reflector stays one, which ends oscillations.
            changes.retain(|change| !was_emitter[change.object]);
            leave_possible(&mut changes, &self.roles, &self.monitor.known);
            if scanned {
                leave_brightest(&mut changes);
            }
            if changes.is_empty() {
                break;
            }
            for change in changes {
                let (k, role) = (change.object, change.role);
                self.roles[k] = role;
                if role.emits() {
                    self.unknowns.albedo[k] = Vec3::ZERO;
                    self.unknowns.emission[k] = change.value;
                } else {
                    was_emitter[k] = true;
                    self.unknowns.albedo[k] = change.value;
                    self.unknowns.emission[k] = Vec3::ZERO;
                }
            }
            self.hold();
            fitted = self.fit(cache)?;
            self.take_values(&fitted);
        }
        self.take(&fitted);
        self.prune_unseen(cache)
    }

    /// Adds emission to reflectors or dark objects: the one with the most significant score test is set free, refitted, and kept if
    /// it stays significant. Returns the names of the added lamps. The light on a scan's surfaces is too uncertain to tell emission
    /// from albedo, so that its reflectors get none.
    ///
    /// The first rejection ends the search: less significant candidates are due to textures or highlights.
    pub(super) fn test_glow(&mut self, cache: &PathCache) -> Result<Vec<String>> {
        let objects = self.roles.len();
        let in_mesh = self.problem.scene.objects.len();
        let mut added = Vec::new();
        while added.len() < MAX_GLOWING {
            let tested = self.test_dark(cache);
            let open = |test: &ScoreTest| {
                let k = test.index - objects;
                let can_emit = self.roles[k] == Role::Dark || !self.problem.scene.scanned;
                k < in_mesh && can_emit && !self.emission_is_known(k)
            };
            let strongest = (tested.into_iter())
                .filter(open)
                .max_by(|a, b| a.significance().total_cmp(&b.significance()));
            let Some(candidate) = strongest.filter(|c| c.significance() > SIGNIFICANT) else {
                break;
            };
            let k = candidate.index - objects;
            let before = self.found();
            self.roles[k] = if self.roles[k] == Role::Dark {
                Role::Unseen
            } else {
                Role::Glowing
            };
            let fitted = self.fit(cache)?;
            self.take(&fitted);
            let faint = self.unknowns.emission[k].max_element() < FAINT * self.brightness[k];
            if self.significance(k) < SIGNIFICANT || faint {
                self.go_back_to(before);
                break;
            }
            added.push(self.problem.scene.objects[k].name.clone());
        }
        Ok(added)
    }

    /// Emitters with the present emission, sampled in proportion to area × luminance.
    pub(super) fn lights(&self) -> Emitters {
        Emitters::new(&self.problem.scene, &self.light_weights())
    }

    /// Area × luminance of the present emission of each object.
    pub(super) fn light_weights(&self) -> Vec<f64> {
        let emission = self.unknowns.emission.iter().copied();
        powers(&self.problem.scene, emission)
    }

    /// Adds a fraction of the weights to all objects with an area.
    pub(super) fn explore(&self, weights: Vec<f64>) -> Vec<f64> {
        let objects = &self.problem.scene.objects;
        let extended: Vec<usize> = (0..objects.len())
            .filter(|&k| objects[k].area > 0.0)
            .collect();
        self.spread(weights, &extended, EXPLORATION)
    }

    /// Adds `fraction` of the sum of the weights to the objects in `over`, which have an area: half by area, half by number.
    pub(super) fn spread(&self, mut weights: Vec<f64>, over: &[usize], fraction: f64) -> Vec<f64> {
        let area = |k: usize| self.problem.scene.objects[k].area;
        let total: f64 = weights.iter().sum();
        let added = if total > 0.0 { total * fraction } else { 1.0 };
        let all: f64 = over.iter().map(|&k| area(k)).sum();
        for &k in over {
            weights[k] += added * 0.5 * (area(k) / all + 1.0 / over.len() as f64);
        }
        weights
    }
}

/// Removes changes of roles that known values do not allow.
fn leave_possible(changes: &mut Vec<Change>, roles: &[Role], known: &Known) {
    for change in changes.iter_mut() {
        change.role = role_under(known.object(change.object), change.role);
    }
    changes.retain(|change| change.role != roles[change.object]);
}

/// Removes all changes to emitters but the brightest one. Lamps of a scan are saturated, and so are surfaces beside them: once the
/// lamp is as bright as the room tells, these may be explained by its light.
fn leave_brightest(changes: &mut Vec<Change>) {
    let emitters = (changes.iter()).filter(|change| change.role.emits());
    let brightest = emitters
        .max_by(|a, b| a.value.length().total_cmp(&b.value.length()))
        .map(|change| change.object);
    changes.retain(|change| !change.role.emits() || Some(change.object) == brightest);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::known::Pinned;

    fn change(object: usize, role: Role, value: f32) -> Change {
        Change {
            object,
            role,
            value: Vec3::splat(value),
        }
    }

    #[test]
    fn a_segment_that_is_known_to_be_dark_does_not_keep_the_others_from_being_lamps() {
        let mut known = Known::default();
        let dark = Pinned {
            emission: Some(Vec3::ZERO),
            ..Pinned::default()
        };
        known.set(0, dark);
        let mut changes = vec![change(0, Role::Emitter, 9.0), change(1, Role::Emitter, 5.0)];
        leave_possible(&mut changes, &[Role::Reflector; 2], &known);
        leave_brightest(&mut changes);
        assert_eq!(changes.len(), 1);
        assert_eq!((changes[0].object, changes[0].role), (1, Role::Emitter));
    }

    #[test]
    fn of_the_new_lamps_of_a_scan_the_brightest_comes_first() {
        let mut changes = vec![
            change(0, Role::Emitter, 2.0),
            change(1, Role::Reflector, 0.5),
            change(2, Role::Emitter, 8.0),
            change(3, Role::Emitter, 7.0),
        ];
        leave_brightest(&mut changes);
        let left: Vec<usize> = changes.iter().map(|change| change.object).collect();
        assert_eq!(left, [1, 2]);
        let mut none = vec![change(1, Role::Reflector, 9.0)];
        leave_brightest(&mut none);
        assert_eq!(none.len(), 1);
    }
}
