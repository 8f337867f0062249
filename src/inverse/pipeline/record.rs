//! Reports of a solve: the present estimate, stages with their losses, and checkpoints.

use crate::inverse::fit::model_error;
use crate::inverse::loss::Losses;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::pipeline::state::SolverState;
use crate::inverse::pipeline::{Pipeline, STAGES, describe};
use crate::inverse::solver::{Checkpoint, Solution, Stage, Termination};

impl Pipeline<'_, '_> {
    /// Updates the estimate from the present unknowns.
    pub(super) fn describe(&mut self) {
        self.estimate = describe::estimate(
            &self.problem.scene,
            &self.gbuffer,
            &self.roles,
            &self.unknowns,
            &self.errors,
            self.outside,
            self.sky.as_ref(),
            &self.lobes,
        );
        model_error::add_to(&mut self.estimate, &self.roles, self.model_variance);
        model_error::add_gloss(&mut self.estimate, &self.roles);
        // One known albedo settles the factor.
        let settled = (self.monitor.known.objects()).any(|(_, known)| known.albedo.is_some());
        if self.problem.scene.scanned && !settled {
            model_error::add_common(&mut self.estimate, &self.roles);
        }
        let exposures = self.exposures.as_ref();
        self.estimate.exposures = (exposures.filter(|e| e.differ)).map(|e| e.factors.clone());
        self.estimate.vignetting = exposures.and_then(|e| e.vignetting);
        self.estimate.response = exposures.and_then(|e| e.response);
        if let Some(detail) = &self.detail {
            let object_of = &self.problem.scene.object_of;
            let refined = detail.scaled_to(&self.unknowns.albedo, object_of);
            refined.apply(&mut self.estimate);
        }
        describe::doubt_white(&mut self.estimate, &self.brightness);
        self.describe_known();
    }

    /// Estimates the variance of the model error from the residuals of a fit.
    pub(super) fn tell_model_error(&mut self, residuals: &[Linearised]) {
        let textured = self.estimate.texels.as_ref().map(|t| t.textured.as_slice());
        self.model_variance = model_error::variance(
            &self.clusters,
            residuals,
            &self.unknowns,
            textured.unwrap_or(&[]),
        );
    }

    /// The losses of the present estimate.
    pub(super) fn measure(&mut self) -> Losses {
        let losses = self.losses.measure(self.problem, &self.estimate);
        self.monitor.cast(losses.cast);
        losses
    }

    /// Records a stage with its losses, and adds them to the loss curve.
    pub(super) fn record(
        &mut self,
        name: &str,
        started: f64,
        kept: bool,
        why: String,
    ) -> Result<Losses, Termination> {
        let losses = self.measure();
        self.monitor.loss(losses.train, losses.held_out);
        let stage = Stage {
            name: name.to_owned(),
            seconds: self.monitor.seconds() - started,
            iterations: self.monitor.progress.iterations,
            train_loss: losses.train,
            held_out_loss: losses.held_out,
            kept,
            why,
        };
        self.monitor.stage(stage);
        self.monitor
            .report(&self.estimate, &|_| self.checkpoint.clone())?;
        Ok(losses)
    }

    /// Records a stage that leaves the estimate as it is, without losses.
    pub(super) fn record_unmeasured(&mut self, name: &str, started: f64, kept: bool, why: String) {
        self.monitor.stage(Stage {
            name: name.to_owned(),
            seconds: self.monitor.seconds() - started,
            iterations: self.monitor.progress.iterations,
            train_loss: None,
            held_out_loss: None,
            kept,
            why,
        });
    }

    /// Ends a stage: updates the checkpoint, and offers it to the observer.
    pub(super) fn end_stage(&mut self, stages: u32) -> Result<(), Termination> {
        self.keep_checkpoint(stages);
        self.monitor
            .report(&self.estimate, &|_| self.checkpoint.clone())
    }

    /// Updates the checkpoint after `stages` finished stages.
    pub(super) fn keep_checkpoint(&mut self, stages: u32) {
        self.stages = stages;
        self.monitor.progress.seconds = self.monitor.seconds();
        let mut state = SolverState::new(
            stages,
            self.open,
            &self.prior,
            &self.roles,
            &self.unknowns,
            &self.errors,
            &self.lobes,
        );
        state.model_variance = self.model_variance;
        state.surroundings = self.outside.surroundings;
        state.sun = self.outside.sun;
        self.checkpoint = Checkpoint::new(&self.monitor.progress, &state);
    }

    /// The solution; it has a checkpoint unless the solve is complete.
    pub(super) fn finish(mut self, termination: Termination) -> Solution {
        // A complete solve has measured the loss of its last stage.
        let done = self.stages >= STAGES || termination == Termination::Converged;
        if !done {
            let losses = self.measure();
            self.monitor.loss(losses.train, losses.held_out);
        }
        self.monitor.phase("done");
        self.monitor.progress.seconds = self.monitor.seconds();
        Solution {
            estimate: self.estimate,
            progress: self.monitor.progress,
            termination,
            checkpoint: (!done).then_some(self.checkpoint),
        }
    }
}
