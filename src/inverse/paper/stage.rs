//! The stages of a descent: per object, per triangle, and on parts of triangles.

use crate::inverse::paper::Run;
use crate::inverse::paper::descent::Descent;
use crate::inverse::paper::pace::Pace;
use crate::inverse::paper::patches::{MAX_DEPTH, Patches};
use crate::inverse::paper::schedule::{Rule, Schedule};
use crate::inverse::solver::{Stage, Termination};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Last level of the pace for objects.
pub const LEVELS: u32 = 6;
/// Last level of the pace for patches.
const PATCH_LEVELS: u32 = 3;
/// Paths between two measurements, relative to the paths of a measurement.
const MEASURE_EVERY: u64 = 6;
/// Mean number of batch pixels that see a patch between two measurements.
const MEETINGS: u64 = 8;
/// When the loss of a level has converged, for objects.
const RULE: Rule = Rule {
    window: 4,
    decrease: 0.01,
};
/// The same for patches: a texture is part of few pixels, so that the loss falls slowly while it forms.
const PATCH_RULE: Rule = Rule {
    window: 4,
    decrease: 0.002,
};

/// Patches that are cut are cut again until their parts cover no more pixels of all photographs together. A texture within them shows
/// after cutting once more.
const MAX_COVERED: u64 = 32;
/// Consecutive stages without a gain that end the descent: a texture may show only after cutting twice.
const FRUITLESS: u32 = 2;

/// The values with the least loss.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Best {
    albedo: Vec<Vec3>,
    emission: Vec<Vec3>,
    train: Option<f64>,
    held_out: Option<f64>,
    /// [`Best::compared`] at the start of the stage.
    at_first: Option<f64>,
}

impl Best {
    pub fn fits(&self, descent: &Descent) -> bool {
        self.albedo.len() == descent.albedo.len() && self.emission.len() == descent.emission.len()
    }

    /// The loss that states are compared by: on held-out pixels, or in the fit if no pixel is held out.
    fn compared(&self) -> Option<f64> {
        self.held_out.or(self.train)
    }
}

/// Whether a loss is below another; NaN is above all numbers.
fn is_below(loss: Option<f64>, other: Option<f64>) -> bool {
    match (loss, other) {
        (Some(loss), Some(other)) => loss < other || other.is_nan() && !loss.is_nan(),
        // Without a measurement the newer state is preferred.
        _ => true,
    }
}

impl Run<'_, '_> {
    pub fn descend(&mut self) -> Result<Termination, Termination> {
        loop {
            self.monitor.phase(&match self.covered.len() {
                0 => "descending per object".to_owned(),
                patches => match self.state.cuts {
                    0 => format!("descending per triangle, {patches}"),
                    cuts => format!("descending on triangles cut {cuts} ×, {patches}"),
                },
            });
            let ended = self.stage();
            // The state of an interrupted stage is kept for the checkpoint.
            let interrupted = ended.is_err().then(|| self.state.clone());
            self.finish_stage();
            if let Some(state) = interrupted {
                self.state = state;
            }
            ended?;
            let goes_on = self.state.fruitless < FRUITLESS && self.monitor.settings.textures;
            if !(goes_on && self.refine()) {
                return Ok(Termination::Converged);
            }
            // Whoever watches sees what the stage left; a checkpoint has the next one.
            self.tell()?;
            self.describe();
        }
    }

    /// Descends until the loss has converged at the last level.
    fn stage(&mut self) -> Result<(), Termination> {
        loop {
            // Step until a report is due, measuring the loss by the schedule.
            let settings = self.monitor.settings.clone();
            while !self.monitor.due() {
                let iterations = self.monitor.progress.iterations;
                if settings.steps > 0 && iterations >= settings.steps {
                    return Err(Termination::Steps);
                }
                if self.state.schedule.due() {
                    let loss = self.measure();
                    let (levels, rule) = match self.state.descent.patches {
                        None => (LEVELS, RULE),
                        Some(_) => (PATCH_LEVELS, PATCH_RULE),
                    };
                    let next = self.until_measured();
                    if self.state.schedule.measured(loss, next, rule) {
                        if !settings.anneal || self.state.descent.level >= levels {
                            return Ok(());
                        }
                        self.state.descent.slow_down();
                        self.state.schedule.start_over();
                    }
                }
                let outcome = (self.state.descent).step(self.problem, &settings, self.bounces);
                (self.state.descent).hold(&self.problem.scene, &self.monitor.known);
                self.state.schedule.traced(outcome.paths);
                self.monitor.cast(outcome.cast);
                if !outcome.finite {
                    return Err(Termination::Diverged);
                }
                self.monitor.progress.iterations += 1;
            }
            self.monitor
                .progress
                .seconds_to_first_estimate
                .get_or_insert(self.monitor.seconds());
            self.report()?;
        }
    }

    fn until_measured(&self) -> u64 {
        let seen = self.covered.iter().filter(|&&pixels| pixels > 0).count() as u64;
        let pace = Pace::new(&self.state.descent, &self.monitor.settings);
        let paths = MEETINGS * seen * (pace.samples[0] + pace.samples[1]);
        paths.max(MEASURE_EVERY * self.losses.paths()).max(1)
    }

    /// Adds a point to the loss curve, and keeps the state if it is the best of the stage; returns the loss in the fit.
    fn measure(&mut self) -> Option<f64> {
        self.describe();
        let loss = self.losses.measure(self.problem, &self.estimate);
        self.monitor.cast(loss.cast);
        self.monitor.loss(loss.train, loss.held_out);
        let compared = loss.held_out.or(loss.train);
        let best = self.state.best.as_ref();
        if best.is_none_or(|best| is_below(compared, best.compared())) {
            let (albedo, emission) = self.state.descent.averaged();
            self.state.best = Some(Best {
                albedo: albedo.to_vec(),
                emission: emission.to_vec(),
                train: loss.train,
                held_out: loss.held_out,
                at_first: best.map_or(compared, |best| best.at_first),
            });
        }
        loss.train
    }

    /// Sets the best state of the stage and records it, in place of the record of an earlier, interrupted part of the same stage.
    fn finish_stage(&mut self) {
        self.measure();
        let Some(best) = self.state.best.take() else {
            return;
        };
        let kept = is_below(best.compared(), best.at_first) || self.state.descent.patches.is_none();
        let words = |loss: Option<f64>| loss.map_or("-".to_owned(), |loss| format!("{loss:.4}"));
        let course = format!(
            "loss from {} to {} on {}",
            words(best.at_first),
            words(best.compared()),
            match best.held_out {
                Some(_) => "held-out pixels",
                None => "pixels in the fit",
            }
        );
        let patches = self.state.descent.patches.as_ref().map(Patches::len);
        let (name, what) = match (patches, self.state.cuts) {
            (None, _) => {
                let what = "one albedo and one emission an object".to_owned();
                ("objects".to_owned(), what)
            }
            (Some(n), 0) => {
                let what = "triangles, lamps stay in place";
                ("triangles".to_owned(), format!("{n} {what}"))
            }
            (Some(n), cuts) => {
                let what = "parts of triangles, cut where pixels are worst";
                (format!("cut {cuts}"), format!("{n} {what}"))
            }
        };
        let (started, iterations) = self.state.stage_started;
        let ended = self.monitor.seconds();
        let progress = &mut self.monitor.progress;
        progress.stages.retain(|stage| stage.name != name);
        progress.stages.push(Stage {
            name,
            seconds: ended - started,
            ended,
            iterations: progress.iterations.saturating_sub(iterations),
            train_loss: best.train,
            held_out_loss: best.held_out,
            kept,
            why: format!("{what}: {course}"),
        });
        self.state.fruitless = if kept { 0 } else { self.state.fruitless + 1 };
        self.state.descent.set(best.albedo, best.emission);
        self.describe();
    }

    /// Starts the next stage: an albedo for each triangle, then the worst patches cut into four. `false` if there is none.
    fn refine(&mut self) -> bool {
        let scene = &self.problem.scene;
        let (mut which, cuts) = match self.state.descent.patches {
            None if scene.triangles.len() <= scene.objects.len() => return false,
            None => (Vec::new(), 0),
            Some(_) => {
                let (settings, descent) = (&self.monitor.settings, &mut self.state.descent);
                let (worst, cast) =
                    (self.cover).to_cut(self.problem, settings, self.bounces, descent);
                self.monitor.cast(cast);
                if !worst.contains(&true) {
                    return false;
                }
                (worst, self.state.cuts + 1)
            }
        };
        loop {
            let (refined, parents) = self.state.descent.refined(scene, &which);
            self.state.descent = refined;
            self.update_cover();
            let Some(patches) = self.state.descent.patches.as_ref().filter(|_| cuts > 0) else {
                break;
            };
            // Parts of what was cut that are too large still.
            which = (parents.iter().zip(&patches.depth).zip(&self.covered))
                .map(|((&parent, &depth), &covered)| {
                    which[parent as usize] && covered > MAX_COVERED && depth < MAX_DEPTH
                })
                .collect();
            if !which.contains(&true) {
                break;
            }
        }
        self.state.schedule = Schedule::default();
        self.state.cuts = cuts;
        self.state.stage_started = (self.monitor.seconds(), self.monitor.progress.iterations);
        true
    }

    /// Counts the pixels of each patch, and fixes the albedos of those without any.
    fn update_cover(&mut self) {
        let patches = self.state.descent.patches.as_ref();
        let counts = patches.map(|patches| self.cover.counts(patches));
        self.covered = counts.unwrap_or_default();
        self.state.descent.fix_uncovered(&self.covered);
    }
}
