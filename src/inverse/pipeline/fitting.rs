//! One fit of all free parameters to stored paths, and values that are known and held fixed through all fits.

use crate::inverse::fit::equations::NormalEquations;
use crate::inverse::fit::errors::{ScoreTest, StandardErrors, score_tests, standard_errors};
use crate::inverse::fit::gauss_newton::{Fit, fit};
use crate::inverse::fit::prior_terms::PriorTerms;
use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::fit::sparse_rows::SparseRows;
use crate::inverse::known::Pinned;
use crate::inverse::paths::PathCache;
use crate::inverse::pipeline::{Pipeline, Result};
use crate::inverse::roles::{self, Role};
use glam::{DVec3, Vec3};

const MAX_STEPS: u64 = 30;
/// Least area of an unseen surface whose albedo is fitted, as a fraction of the mesh's area. Smaller ones change the light in the
/// room by less than the target errors.
const UNSEEN_AREA: f64 = 1e-3;

impl Pipeline<'_, '_> {
    /// The free parameters. In the light field an unseen surface has one, its exitant radiance; full paths tell its albedo too.
    pub(super) fn free(&self) -> Vec<usize> {
        let has_albedo = |k: usize| !self.roles[k].is_lamp() && self.has_free_albedo(k);
        roles::free(&self.roles, has_albedo)
    }

    /// Whether a surface's albedo is fitted, unless it is a lamp: it is seen, or unseen and of [`UNSEEN_AREA`] or more.
    pub(super) fn has_free_albedo(&self, k: usize) -> bool {
        match self.gbuffer.seen.get(k) {
            None => false,
            // Emission and reflection of an unseen lamp cannot be separated.
            Some(0) if self.stages == 0 || self.roles[k] == Role::Unseen => false,
            Some(0) => self.problem.scene.objects[k].area > UNSEEN_AREA * self.mesh_area,
            Some(_) => true,
        }
    }

    /// Fits the free parameters to stored paths, starting at the present unknowns.
    pub(super) fn fit(&mut self, cache: &PathCache) -> Result<Fit> {
        let free = self.free();
        let (monitor, estimate, checkpoint) = (&mut self.monitor, &self.estimate, &self.checkpoint);
        let fitted = fit(
            cache,
            &self.unknowns,
            &free,
            &self.robust,
            &self.prior,
            MAX_STEPS,
            |equations| {
                monitor.progress.iterations += 1;
                monitor.fitted(equations.relative_residual(), free.len(), estimate);
                monitor.tick(estimate, &|_| checkpoint.clone())
            },
        )?;
        Ok(fitted)
    }

    /// Score tests of the parameters in `free` after the first `active` ones, at the present unknowns.
    pub(super) fn score_tests(
        &self,
        cache: &PathCache,
        free: &[usize],
        active: usize,
    ) -> Vec<ScoreTest> {
        let row_of = roles::places(free, self.unknowns.surfaces());
        let clusters = cache.linearise(&self.unknowns, &row_of, &[]);
        let (n, robust) = (free.len(), &self.robust);
        let equations = NormalEquations::new(&clusters, n, robust, &self.prior);
        let scores = SparseRows::scores(&clusters, n, robust, |_| DVec3::ONE);
        let terms = PriorTerms::new(&equations, &free[..active], &self.unknowns);
        score_tests(&equations, &terms, &scores, free)
    }

    /// Sets the robust weights and the model error from the residuals of the last fit, and fits again.
    pub(super) fn weigh(&mut self, cache: &PathCache) -> Result {
        let residuals = cache.residuals(&self.unknowns);
        self.tell_model_error(&residuals);
        self.tell_outside_share(cache, &residuals);
        self.robust = RobustWeights::from_residuals(&residuals, self.roles.len());
        let fitted = self.fit(cache)?;
        self.take(&fitted);
        Ok(())
    }

    /// Sets the unknowns and standard errors from a fit with the present roles.
    pub(super) fn take(&mut self, fitted: &Fit) {
        let free = self.free();
        let scores = SparseRows::scores(&fitted.clusters, free.len(), &self.robust, |_| DVec3::ONE);
        let (equations, terms) = (&fitted.equations, &fitted.terms);
        let errors = standard_errors(equations, terms, &scores, &free, self.roles.len());
        self.merge_errors(errors);
        self.take_values(fitted);
    }

    /// Sets the unknowns alone, since standard errors of many unknowns are expensive.
    pub(super) fn take_values(&mut self, fitted: &Fit) {
        self.unknowns = fitted.unknowns.clone();
        self.hold();
        self.describe();
    }

    /// Sets the standard errors of fitted parameters. Fixed ones keep those of their score tests.
    pub(super) fn merge_errors(&mut self, errors: StandardErrors) {
        for (k, role) in self.roles.iter().enumerate() {
            if !role.is_lamp() && self.has_free_albedo(k) {
                self.errors.albedo[k] = errors.albedo[k];
            }
            if role.emits() {
                self.errors.emission[k] = errors.emission[k];
            }
        }
    }

    pub(super) fn emission_is_known(&self, object: usize) -> bool {
        self.monitor.known.object(object).emission.is_some()
    }

    /// Sets the roles and values of objects with known values, with standard errors of zero.
    pub(super) fn hold(&mut self) {
        for (k, pinned) in self.monitor.known.objects() {
            if k >= self.problem.scene.objects.len() {
                continue;
            }
            let role = role_under(pinned, self.roles[k]);
            if role != self.roles[k] && role == Role::Emitter {
                self.unknowns.albedo[k] = Vec3::ZERO;
            }
            if !role.emits() {
                self.unknowns.emission[k] = Vec3::ZERO;
            }
            self.roles[k] = role;
            if let Some(albedo) = pinned.albedo {
                (self.unknowns.albedo[k], self.errors.albedo[k]) = (albedo, Vec3::ZERO);
            }
            if let Some(emission) = pinned.emission {
                (self.unknowns.emission[k], self.errors.emission[k]) = (emission, Vec3::ZERO);
            }
        }
    }

    /// Sets known values in the estimate, with a note on each.
    pub(super) fn describe_known(&mut self) {
        for (k, pinned) in self.monitor.known.objects() {
            let Some(object) = self.estimate.objects.get_mut(k) else {
                continue;
            };
            if let Some(albedo) = pinned.albedo {
                (object.albedo, object.albedo_stderr) = (albedo, Vec3::ZERO);
                object.albedo_identifiable = true;
            }
            if let Some(emission) = pinned.emission {
                (object.emission, object.emission_stderr) = (emission, Vec3::ZERO);
            }
            pinned.words().clone_into(&mut object.note);
        }
    }
}

/// The role, according to the photographs and under known values: a known emission decides whether the object emits, and with a
/// known albedo it reflects.
pub(super) fn role_under(pinned: Pinned, role: Role) -> Role {
    let emits = pinned.emission.map(|emission| emission != Vec3::ZERO);
    match (emits, role) {
        (Some(false), Role::Emitter | Role::Glowing) => Role::Reflector,
        (Some(false), Role::Unseen) => Role::Dark,
        (Some(true), Role::Dark) => Role::Unseen,
        (Some(true), Role::Reflector) | (_, Role::Emitter) if pinned.albedo.is_some() => {
            Role::Glowing
        }
        (Some(true), Role::Reflector) => Role::Emitter,
        _ => role,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_decides_the_role() {
        let [dark, light] = [Vec3::ZERO, Vec3::splat(3.0)].map(Some);
        let grey = Some(Vec3::splat(0.5));
        for (albedo, emission, role, wanted) in [
            (None, None, Role::Emitter, Role::Emitter),
            (None, dark, Role::Emitter, Role::Reflector),
            (None, dark, Role::Glowing, Role::Reflector),
            (None, dark, Role::Unseen, Role::Dark),
            (None, light, Role::Reflector, Role::Emitter),
            (None, light, Role::Dark, Role::Unseen),
            (None, light, Role::Glowing, Role::Glowing),
            (grey, None, Role::Emitter, Role::Glowing),
            (grey, None, Role::Reflector, Role::Reflector),
            (grey, light, Role::Reflector, Role::Glowing),
            (grey, dark, Role::Emitter, Role::Reflector),
        ] {
            assert_eq!(role_under(Pinned { albedo, emission }, role), wanted);
        }
    }
}
