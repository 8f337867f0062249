//! The stochastic gradient descent of the paper (Azinović et al. 2019): ADAM on small batches of pixels, first per
//! object, then per triangle with the lights in place, then on triangles that are cut where their pixels are worst.
//!
//! A stage leaves the best that it found by held-out pixels, which is what it began with where nothing was better.
//! Triangles are cut again until that gains nothing.

pub mod adam;
mod cover;
pub mod descent;
mod describe;
mod pace;
mod patches;
pub mod pixel;
mod schedule;
mod stage;

use crate::calibrate::gbuffer::GBuffer;
use crate::calibrate::held_out::HoldOut;
use crate::calibrate::problem::Problem;
use crate::error;
use crate::inverse::estimate::Estimate;
use crate::inverse::loss::LossProbe;
use crate::inverse::monitor::Monitor;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Checkpoint, Solution, Termination};
use cover::Cover;
use descent::Descent;
use describe::{describe, untold};
use glam::Vec3;
use schedule::Schedule;
use serde::{Deserialize, Serialize};
use stage::{Best, LEVELS};
use std::time::{Duration, Instant};

/// Pixels of each set that the loss is measured on, at most and as one in so many of all, and paths for each.
const LOSS_PIXELS: usize = 1000;
const LOSS_FRACTION: usize = 32;
const LOSS_SAMPLES: u64 = 32;
/// Pictures of patches are made anew after so long; they hold a colour a texel.
const DESCRIBE_EVERY: Duration = Duration::from_millis(200);

/// What a checkpoint holds: everything that decides how the descent goes on.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct State {
    descent: Descent,
    schedule: Schedule,
    /// The best of this stage so far.
    best: Option<Best>,
    /// How often triangles were cut.
    cuts: u32,
    /// Stages on end that gained nothing.
    fruitless: u32,
    /// Seconds and iterations at the start of the present stage.
    stage_started: (f64, u64),
}

/// A descent under way.
struct Run<'a, 'o> {
    problem: &'a Problem,
    monitor: Monitor<'o>,
    gbuffer: GBuffer,
    /// For each object why the photographs tell nothing of it; empty where they do.
    notes: Vec<&'static str>,
    losses: LossProbe,
    bounces: u32,
    cover: Cover,
    /// Pixels that each patch covers.
    covered: Vec<u64>,
    state: State,
    estimate: Estimate,
    described: Instant,
}

/// Runs the paper's optimiser until time, steps or a standstill end it.
///
/// # Errors
/// The checkpoint belongs to another capture.
pub fn solve(
    problem: &Problem,
    settings: &Settings,
    resume: Option<&Checkpoint>,
    monitor: Monitor,
) -> error::Result<Solution> {
    let gbuffer = GBuffer::new(problem, HoldOut::from(settings), settings.seed, 400_000);
    let bounces = settings.max_bounces();
    let mut state = match resume {
        None => State {
            descent: Descent::new(problem),
            schedule: Schedule::default(),
            best: None,
            cuts: 0,
            fruitless: 0,
            stage_started: (0.0, 0),
        },
        Some(checkpoint) => checkpoint.state(|state: &State| {
            let (descent, scene) = (&state.descent, &problem.scene);
            let best = state.best.as_ref();
            let is_its_own = best.is_none_or(|best| best.fits(descent));
            descent.fits(scene) && descent.level <= LEVELS && is_its_own
        })?,
    };
    let notes = untold(problem, &gbuffer);
    state.descent.hold(&problem.scene, &monitor.known);
    let cover = Cover::new(problem, settings);
    let covered = (state.descent.patches.as_ref()).map(|patches| cover.counts(patches));
    let covered = covered.unwrap_or_default();
    let pixels: usize = problem.photographs.iter().map(|p| p.pixels.len()).sum();
    let loss_pixels = (pixels / LOSS_FRACTION).clamp(1, LOSS_PIXELS);
    let mut run = Run {
        estimate: describe(problem, &gbuffer, &notes, &state.descent, &covered),
        losses: LossProbe::new(problem, settings, loss_pixels, LOSS_SAMPLES, bounces),
        problem,
        monitor,
        gbuffer,
        notes,
        bounces,
        cover,
        covered,
        state,
        described: Instant::now(),
    };
    let counted = std::mem::take(&mut run.covered);
    run.state.descent.keep_still(&counted);
    run.covered = counted;
    let termination = match run.descend() {
        Ok(termination) | Err(termination) => termination,
    };
    run.monitor.phase("done");
    run.monitor.progress.seconds = run.monitor.seconds();
    let resumable = !matches!(termination, Termination::Converged | Termination::Diverged);
    Ok(Solution {
        checkpoint: resumable.then(|| Checkpoint::new(&run.monitor.progress, &run.state)),
        estimate: run.estimate,
        progress: run.monitor.progress,
        termination,
    })
}

impl Run<'_, '_> {
    /// The estimate of the present state.
    fn describe(&mut self) {
        self.described = Instant::now();
        let (descent, covered) = (&self.state.descent, &self.covered);
        self.estimate = describe(self.problem, &self.gbuffer, &self.notes, descent, covered);
        for (k, pinned) in self.monitor.known.objects() {
            let Some(object) = self.estimate.objects.get_mut(k) else {
                continue;
            };
            if pinned.albedo.is_some() {
                object.albedo_stderr = Vec3::ZERO;
            }
            if pinned.emission.is_some() {
                object.emission_stderr = Vec3::ZERO;
            }
            pinned.words().clone_into(&mut object.note);
        }
    }

    /// Tells the observer where the descent stands.
    fn report(&mut self) -> Result<(), Termination> {
        if self.covered.is_empty() || self.described.elapsed() >= DESCRIBE_EVERY {
            self.describe();
        }
        let state = &self.state;
        self.monitor
            .report(&self.estimate, &|progress| Checkpoint::new(progress, state))
    }
}
