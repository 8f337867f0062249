//! One fit of all free parameters to stored paths.

use crate::inverse::fit::errors::{StandardErrors, standard_errors};
use crate::inverse::fit::gauss_newton::{Fit, fit};
use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::paths::PathCache;
use crate::inverse::pipeline::Pipeline;
use crate::inverse::roles;
use crate::inverse::roles::Role;
use crate::inverse::solver::Termination;

/// Greatest number of Gauss–Newton steps in one fit.
const MAX_STEPS: u64 = 30;
/// Least area of an unseen surface whose albedo is fitted, as a fraction of the mesh's area. Smaller ones change the light in the
/// room by less than the target errors.
const UNSEEN_AREA: f64 = 1e-3;

impl Pipeline<'_, '_> {
    /// The free parameters. In the light field an unseen surface has one unknown, its exitant radiance; full paths determine its
    /// albedo too.
    pub(super) fn free(&self) -> Vec<usize> {
        let has_albedo = |k| self.roles[k] != Role::Emitter && self.has_free_albedo(k);
        roles::free(&self.roles, has_albedo)
    }

    /// Whether a surface's albedo is fitted, unless it is a lamp: photographs see it, or it is an unseen surface of at least
    /// [`UNSEEN_AREA`].
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

    /// Sets the robust weights and the model error from the residuals of the last fit, and fits again.
    pub(super) fn weigh(&mut self, cache: &PathCache) -> Result<(), Termination> {
        let residuals = cache.residuals(&self.unknowns);
        self.tell_model_error(&residuals);
        self.robust = RobustWeights::from_residuals(&residuals, self.roles.len());
        let fitted = self.fit(cache)?;
        self.take(&fitted);
        Ok(())
    }

    /// Sets the unknowns and standard errors from a fit with the present roles.
    pub(super) fn take(&mut self, fitted: &Fit) {
        let free = self.free();
        let errors = standard_errors(&fitted.equations, &free, self.roles.len());
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
            if *role != Role::Emitter && self.has_free_albedo(k) {
                self.errors.albedo[k] = errors.albedo[k];
            }
            if role.emits() {
                self.errors.emission[k] = errors.emission[k];
            }
        }
    }
}
