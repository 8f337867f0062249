//! The stages of a descent: what each begins with, when it ends, and what it leaves.

use crate::inverse::paper::descent::Descent;
use crate::inverse::paper::pace::Pace;
use crate::inverse::paper::patches::MAX_DEPTH;
use crate::inverse::paper::schedule::Schedule;
use crate::inverse::paper::{Run, State};
use crate::inverse::solver::{Stage, Termination};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Levels of the pace after the first: of one albedo an object, and of patches.
pub const LEVELS: u32 = 6;
const PATCH_LEVELS: u32 = 3;
/// Paths between two measurements, in those that a measurement takes.
const MEASURE_EVERY: u64 = 6;
/// Between two measurements a patch in sight is met this often in the mean.
const MEETINGS: u64 = 8;
/// Measurements whose mean is compared with that of as many before.
const WINDOW: usize = 4;
const PATCH_WINDOW: usize = 2;

/// Pixels that a patch covers at most: a texture that a square of sixteen pixels a side hides is found by cutting it twice.
const MAX_COVERED: u64 = 256;
/// Stages on end that gain nothing before the descent ends: a texture may show only once triangles were cut twice.
const FRUITLESS: u32 = 2;

/// Values and their loss.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Best {
    albedo: Vec<Vec3>,
    emission: Vec<Vec3>,
    /// On pixels in the fit and held out.
    train: Option<f64>,
    held_out: Option<f64>,
    /// The loss that stages are judged by, when this stage began: held-out, or in the fit where nothing is held out.
    at_first: Option<f64>,
}

impl Best {
    /// Whether they are values of such a state.
    pub fn fits(&self, descent: &Descent) -> bool {
        self.albedo.len() == descent.albedo.len() && self.emission.len() == descent.emission.len()
    }

    fn judged(&self) -> Option<f64> {
        self.held_out.or(self.train)
    }
}

/// Whether a loss is below another; one that is no number is above all.
fn is_below(loss: Option<f64>, other: Option<f64>) -> bool {
    match (loss, other) {
        (Some(loss), Some(other)) => loss < other || other.is_nan() && !loss.is_nan(),
        // Nothing was measured: what is newer has descended further.
        _ => true,
    }
}

impl Run<'_, '_> {
    /// Descends per object, per triangle, and on ever smaller patches.
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
            // What was broken off can be taken up where it was.
            let open = ended.is_err().then(|| self.state.clone());
            self.finish_stage();
            if let Some(open) = open {
                self.state = open;
            }
            ended?;
            let goes_on = self.state.fruitless < FRUITLESS && self.monitor.settings.textures;
            if !(goes_on && self.refine()) {
                return Ok(Termination::Converged);
            }
            self.describe();
            self.report()?;
        }
    }

    /// Descends until the loss stands still at the last level.
    fn stage(&mut self) -> Result<(), Termination> {
        loop {
            // Step until the observer is due, measuring now and then.
            let settings = self.monitor.settings.clone();
            while !self.monitor.due() {
                let iterations = self.monitor.progress.iterations;
                if settings.steps > 0 && iterations >= settings.steps {
                    return Err(Termination::Steps);
                }
                if self.state.schedule.due() {
                    let loss = self.measure();
                    let (levels, window) = match self.state.descent.patches {
                        None => (LEVELS, WINDOW),
                        Some(_) => (PATCH_LEVELS, PATCH_WINDOW),
                    };
                    let next = self.until_measured();
                    if self.state.schedule.measured(loss, next, window) {
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

    /// Paths until the next measurement.
    fn until_measured(&self) -> u64 {
        let in_sight = self.covered.iter().filter(|&&pixels| pixels > 0).count() as u64;
        let pace = Pace::of(&self.state.descent, &self.monitor.settings);
        let meetings = MEETINGS * in_sight * (pace.samples[0] + pace.samples[1]);
        meetings.max(MEASURE_EVERY * self.losses.paths()).max(1)
    }

    /// Adds a point to the loss curve and keeps the state if it is the best of the stage; returns the loss in the fit.
    fn measure(&mut self) -> Option<f64> {
        self.describe();
        let loss = self.losses.measure(self.problem, &self.estimate);
        self.monitor.cast(loss.cast);
        self.monitor.loss(loss.train, loss.held_out);
        let judged = loss.held_out.or(loss.train);
        let best = self.state.best.as_ref();
        if best.is_none_or(|best| is_below(judged, best.judged())) {
            let descent = &self.state.descent;
            self.state.best = Some(Best {
                albedo: descent.albedo.clone(),
                emission: descent.emission.clone(),
                train: loss.train,
                held_out: loss.held_out,
                at_first: best.map_or(judged, |best| best.at_first),
            });
        }
        loss.train
    }

    /// Leaves the best state of the stage and records it. One that an earlier run had broken off takes the place of its
    /// first part.
    fn finish_stage(&mut self) {
        self.measure();
        let Some(best) = self.state.best.take() else {
            return;
        };
        let kept = is_below(best.judged(), best.at_first) || self.state.descent.patches.is_none();
        let words = |loss: Option<f64>| loss.map_or("-".to_owned(), |loss| format!("{loss:.4}"));
        let course = format!(
            "loss from {} to {} on {}",
            words(best.at_first),
            words(best.judged()),
            match best.held_out {
                Some(_) => "held-out pixels",
                None => "pixels in the fit",
            }
        );
        let (name, what) = match (&self.state.descent.patches, self.state.cuts) {
            (None, _) => (
                "objects".to_owned(),
                "one albedo and one emission an object".to_owned(),
            ),
            (Some(patches), 0) => (
                "triangles".to_owned(),
                format!(
                    "{} triangles or parts of large ones, lamps stay in place",
                    patches.len()
                ),
            ),
            (Some(patches), cuts) => (
                format!("cut {cuts}"),
                format!(
                    "{} parts of triangles, cut where pixels are worst",
                    patches.len()
                ),
            ),
        };
        let (seconds, iterations) = self.state.stage_started;
        let progress = &mut self.monitor.progress;
        progress.stages.retain(|stage| stage.name != name);
        let stage = Stage {
            name,
            seconds: self.monitor.seconds() - seconds,
            iterations: self.monitor.progress.iterations.saturating_sub(iterations),
            train_loss: best.train,
            held_out_loss: best.held_out,
            kept,
            why: format!("{what}: {course}"),
        };
        self.monitor.stage(stage);
        self.state.fruitless = match kept {
            true => 0,
            false => self.state.fruitless + 1,
        };
        self.state.descent.albedo = best.albedo;
        self.state.descent.set_emission(best.emission);
        self.describe();
    }

    /// Goes on to the next stage: every triangle its own albedo, then the worst cut into four. `false` where there is none.
    fn refine(&mut self) -> bool {
        let scene = &self.problem.scene;
        let mut which = Vec::new();
        if self.state.descent.patches.is_none() {
            if scene.triangles.len() <= scene.objects.len() {
                return false;
            }
        } else {
            let settings = &self.monitor.settings;
            let descent = &mut self.state.descent;
            let (found, cast) = self
                .cover
                .to_cut(self.problem, settings, self.bounces, descent);
            self.monitor.cast(cast);
            if !found.contains(&true) {
                return false;
            }
            which = found;
        }
        let cuts = match self.state.descent.patches {
            None => 0,
            Some(_) => self.state.cuts + 1,
        };
        self.state = State {
            descent: self.state.descent.refined(&self.problem.scene, &which),
            schedule: Schedule::default(),
            best: None,
            cuts,
            fruitless: self.state.fruitless,
            stage_started: (self.monitor.seconds(), self.monitor.progress.iterations),
        };
        self.cover_anew();
        self.cut_to_size();
        true
    }

    /// Cuts what covers very many pixels, as triangles of a wall may, so that errors are compared of parts of a size at
    /// which textures show.
    fn cut_to_size(&mut self) {
        loop {
            let Some(patches) = &self.state.descent.patches else {
                return;
            };
            let covered = self.covered.iter().zip(patches.depth());
            let which: Vec<bool> = covered
                .map(|(&pixels, &depth)| pixels > MAX_COVERED && depth < MAX_DEPTH)
                .collect();
            if !which.contains(&true) {
                return;
            }
            self.state.descent = self.state.descent.refined(&self.problem.scene, &which);
            self.cover_anew();
        }
    }

    /// Counts the pixels that each patch covers.
    fn cover_anew(&mut self) {
        let patches = self.state.descent.patches.as_ref();
        let counts = patches.map(|patches| self.cover.counts(patches));
        self.covered = counts.unwrap_or_default();
        self.state.descent.keep_still(&self.covered);
    }
}
