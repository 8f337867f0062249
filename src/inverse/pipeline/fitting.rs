//! One fit of all free parameters to stored paths: which are free, and what is taken over from it.

use crate::inverse::fit::errors::{StandardErrors, standard_errors};
use crate::inverse::fit::gauss_newton::{Fit, fit};
use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::paths::PathCache;
use crate::inverse::pipeline::Pipeline;
use crate::inverse::roles;
use crate::inverse::roles::Role;
use crate::inverse::solver::Termination;

/// Gauss–Newton steps at most in one fit.
const MAX_STEPS: u64 = 30;
/// Part of the mesh's area that a surface out of sight must have for its albedo to be fitted: what is smaller changes the light
/// in the room by less than the errors that are aimed at.
const UNSEEN_AREA: f64 = 1e-3;

impl Pipeline<'_, '_> {
    /// The parameters that are fitted. What leaves a surface out of sight is one unknown to the light field, however much of it
    /// is reflected; paths that go all the way tell the albedo.
    pub(super) fn free(&self) -> Vec<usize> {
        let has_albedo = |k| self.roles[k] != Role::Emitter && self.has_free_albedo(k);
        roles::free(&self.roles, has_albedo)
    }

    /// Whether a surface's albedo is fitted, if it is no lamp: where photographs see it, or where so much of it is out of sight
    /// that what it reflects counts.
    pub(super) fn has_free_albedo(&self, k: usize) -> bool {
        match self.gbuffer.seen.get(k) {
            None => false,
            // What a lamp out of sight reflects cannot be told from its own light.
            Some(0) if self.stages == 0 || self.roles[k] == Role::Unseen => false,
            Some(0) => self.problem.scene.objects[k].area > UNSEEN_AREA * self.mesh_area,
            Some(_) => true,
        }
    }

    pub(super) fn fit(&mut self, cache: &PathCache) -> Result<Fit, Termination> {
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

    /// Weighs the clusters by the residuals that the last fit left, and fits again.
    pub(super) fn weigh(&mut self, cache: &PathCache) -> Result<(), Termination> {
        let residuals = cache.residuals(&self.unknowns);
        self.tell_model_error(&residuals);
        self.robust = RobustWeights::from_residuals(&residuals, self.roles.len());
        let fitted = self.fit(cache)?;
        self.take(&fitted);
        Ok(())
    }

    /// Takes over a fit under the present roles, with its errors.
    pub(super) fn take(&mut self, fitted: &Fit) {
        let free = self.free();
        let errors = standard_errors(&fitted.equations, &free, self.roles.len());
        self.merge_errors(errors);
        self.take_values(fitted);
    }

    /// Takes over the unknowns alone; errors take longer where unknowns are many.
    pub(super) fn take_values(&mut self, fitted: &Fit) {
        self.unknowns = fitted.unknowns.clone();
        self.hold();
        self.describe();
    }

    /// Takes over the errors of what is fitted; what is held keeps those that its tests gave it.
    pub(super) fn merge_errors(&mut self, errors: StandardErrors) {
        for (k, role) in self.roles.iter().enumerate() {
            if *role != Role::Emitter && self.has_free_albedo(k) {
                self.errors.albedo[k] = errors.albedo[k];
            }
            if role.emits() {
                self.errors.emission[k] = errors.emission[k];
            }
        }
    }
}
