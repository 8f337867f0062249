//! Reports of a solve: the present estimate, stages with their losses, exposures, path depth, and checkpoints.

use crate::calibrate::exposure::Exposures;
use crate::inverse::fit::model_error;
use crate::inverse::loss::LateLight;
use crate::inverse::paths::PathCache;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::pipeline::{MAX_DEPTH, Pipeline, Result, STAGES, describe};
use crate::inverse::solver::{Checkpoint, Solution, Stage, Termination};
use crate::math::color::luminance_f64;
use glam::{DVec2, Vec3};

/// A common fixed depth, in bounces.
const COMMON_DEPTH: u32 = 10;

impl Pipeline<'_, '_> {
    pub(super) fn describe(&mut self) {
        self.estimate = self.fitted_estimate();
        let (variance, share) = (self.model_variance, self.outside_share);
        model_error::add_to(&mut self.estimate, &self.roles, variance, share);
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
        describe::flag_white(&mut self.estimate, &self.brightness);
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

    /// Sets how much of the light in the photographs comes from outside and was not measured there; by paths of the light field, which
    /// end in measured light, how much of it arrives directly. In scans it stays zero: the factor that their albedos share holds the errors of this light.
    pub(super) fn tell_outside_share(&mut self, cache: &PathCache, residuals: &[Linearised]) {
        if self.problem.scene.scanned || !self.open {
            self.outside_share = 0.0;
            return;
        }
        let mut dark = self.unknowns.clone();
        dark.emission[self.outside.first as usize..].fill(Vec3::ZERO);
        let (mut outside, mut all) = (0.0, 0.0);
        for (lit, dark) in residuals.iter().zip(cache.residuals(&dark)) {
            outside += luminance_f64(dark.residual() - lit.residual()) * lit.pixels;
        }
        for cluster in &self.clusters {
            all += luminance_f64(cluster.measured.as_dvec3()) * cluster.pixels.len() as f64;
        }
        self.outside_share = match all > 0.0 {
            true => (outside / all).clamp(0.0, 1.0),
            false => 0.0,
        };
    }

    /// Adds the losses of the present estimate to the loss curve, and returns them: in the fit, and held out.
    fn measure(&mut self) -> [Option<f64>; 2] {
        let losses = self.losses.measure(self.problem, &self.estimate);
        self.monitor.cast(losses.cast);
        self.monitor.loss(losses.train, losses.held_out);
        [losses.train, losses.held_out]
    }

    /// Records a stage with its losses, and adds them to the loss curve.
    pub(super) fn record(&mut self, name: &str, started: f64, kept: bool, why: String) -> Result {
        let [train_loss, held_out_loss] = self.measure();
        self.record_unmeasured(name, started, kept, why);
        if let Some(stage) = self.monitor.progress.stages.last_mut() {
            (stage.train_loss, stage.held_out_loss) = (train_loss, held_out_loss);
        }
        self.monitor
            .report(&self.estimate, &|_| self.checkpoint.clone())
    }

    /// Records a stage that leaves the estimate as it is, without losses.
    pub(super) fn record_unmeasured(&mut self, name: &str, started: f64, kept: bool, why: String) {
        let ended = self.monitor.seconds();
        self.monitor.progress.stages.push(Stage {
            name: name.to_owned(),
            seconds: ended - started,
            ended,
            iterations: self.monitor.progress.iterations,
            train_loss: None,
            held_out_loss: None,
            kept,
            why,
        });
    }

    pub(super) fn tell_exposures(&mut self, exposures: &Exposures, started: f64) {
        let (min, max) = exposures.range();
        let fraction = exposures.gain.max(0.0) * 100.0;
        let mut why = if exposures.differ {
            format!(
                "exposure and white balance of each photograph, {min:.2} to {max:.2} times their median, explain {fraction:.0} % of \
                 the disagreement between photographs on shared surfaces"
            )
        } else {
            format!(
                "exposures would explain only {fraction:.0} % of the disagreement between photographs and are not used"
            )
        };
        if let Some((vignetting, camera)) =
            exposures.vignetting.zip(self.problem.scene.cameras.first())
        {
            let corner = vignetting.factor(&camera.intrinsics, DVec2::ZERO);
            why.push_str(&format!(
                "; vignetting to {:.0} % in the corners explains {:.0} % of the rest",
                corner.element_sum() / 3.0 * 100.0,
                exposures.vignetting_gain * 100.0
            ));
        }
        if let Some(response) = exposures.response {
            let [half, full] =
                [0.5, 1.0].map(|value| response.light(Vec3::splat(value), Vec3::ONE));
            let of_half = half / full * 100.0;
            why.push_str(&format!(
                "; a camera response that maps half of the largest value to {:.0} %, {:.0} % and {:.0} % of the largest radiance \
                 (red, green, blue) explains {:.0} % of what remains",
                of_half.x,
                of_half.y,
                of_half.z,
                exposures.response_gain * 100.0
            ));
        }
        self.record_unmeasured("exposures", started, exposures.needed(), why);
    }

    /// Records the path depth, and the fraction of the photographed light beyond it, or beyond [`COMMON_DEPTH`] if it is unlimited.
    pub(super) fn tell_depth(&mut self) {
        let started = self.monitor.seconds();
        let limit = match self.monitor.settings.bounces {
            0 => None,
            _ => Some(self.max_bounces),
        };
        // Deeper paths than those of a limited solve measure what it leaves out.
        let deep = self.losses.deepened(MAX_DEPTH);
        let bounces = limit.unwrap_or(COMMON_DEPTH);
        let late = deep.beyond(self.problem, &self.estimate, bounces);
        if let Some(late) = &late {
            self.monitor.cast(late.cast);
        }
        self.record_unmeasured("depth", started, true, depth_in_words(limit, late.as_ref()));
    }

    /// Ends a stage: updates the checkpoint, and offers it to the observer.
    pub(super) fn end_stage(&mut self, stages: u32) -> Result {
        self.keep_checkpoint(stages);
        self.monitor
            .report(&self.estimate, &|_| self.checkpoint.clone())
    }

    pub(super) fn keep_checkpoint(&mut self, stages: u32) {
        self.stages = stages;
        self.monitor.progress.seconds = self.monitor.seconds();
        self.checkpoint = Checkpoint::new(&self.monitor.progress, &self.state());
    }

    /// The solution; it has a checkpoint unless the solve is complete.
    pub(super) fn finish(mut self, termination: Termination) -> Solution {
        // A complete solve has measured the loss of its last stage.
        let done = self.stages >= STAGES || termination == Termination::Converged;
        if !done {
            self.measure();
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

/// The path depth, and what lies beyond it, in one sentence.
fn depth_in_words(limit: Option<u32>, late: Option<&LateLight>) -> String {
    let fraction = late.map(|late| {
        format!(
            "{:.2} ± {:.2} % of the light in the photographs",
            late.fraction * 100.0,
            late.stderr * 100.0
        )
    });
    match (limit, fraction) {
        (None, Some(fraction)) => format!(
            "paths end by Russian roulette alone and leave nothing out; with the albedos found, {fraction} comes after {COMMON_DEPTH} bounces"
        ),
        (None, None) => "paths end by Russian roulette alone and leave nothing out".to_owned(),
        (Some(limit), Some(fraction)) => format!(
            "paths end after {limit} bounces, as set, and with the albedos found leave out {fraction}"
        ),
        (Some(limit), None) => format!("paths end after {limit} bounces, as set"),
    }
}
