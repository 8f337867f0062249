//! The stochastic gradient descent of the paper (Azinović et al. 2019): ADAM on small batches of pixels. First each object has
//! an albedo, then each triangle, with fixed lamps, then parts of triangles, which are cut where their pixels are worst.
//!
//! A stage keeps the state with the least loss on held-out pixels, including its start. Triangles are cut until that gains nothing.

pub mod adam;
mod average;
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
use describe::{describe, undetermined};
use glam::Vec3;
use schedule::Schedule;
use serde::{Deserialize, Serialize};
use stage::{Best, LEVELS};
use std::time::{Duration, Instant};

/// Greatest number of pixels in each set of the loss.
const LOSS_PIXELS: usize = 1000;
/// All pixels over the pixels in each set of the loss.
const LOSS_FRACTION: usize = 32;
const LOSS_SAMPLES: u64 = 32;
/// Interval between estimates once there are patches: each allocates a colour per texel.
const DESCRIBE_EVERY: Duration = Duration::from_millis(200);

#[derive(Debug, Clone, Serialize, Deserialize)]
struct State {
    descent: Descent,
    schedule: Schedule,
    best: Option<Best>,
    /// Number of stages that cut triangles.
    cuts: u32,
    fruitless: u32,
    /// Seconds and iterations at the start of the present stage.
    stage_started: (f64, u64),
}

struct Run<'a, 'o> {
    problem: &'a Problem,
    monitor: Monitor<'o>,
    gbuffer: GBuffer,
    /// For each object, why the photographs do not determine it; empty if they do.
    notes: Vec<&'static str>,
    losses: LossProbe,
    bounces: u32,
    cover: Cover,
    /// Number of pixels that each patch covers; empty without patches.
    covered: Vec<u64>,
    state: State,
    estimate: Estimate,
    described: Instant,
}

/// Runs the paper's optimiser until it converges, or a limit of time or steps ends it.
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
    let notes = undetermined(problem, &gbuffer);
    state.descent.hold(&problem.scene, &monitor.known);
    let cover = Cover::new(problem, settings);
    let covered =
        (state.descent.patches.as_ref()).map_or_else(Vec::new, |patches| cover.counts(patches));
    let loss_pixels = (problem.pixels() / LOSS_FRACTION).clamp(1, LOSS_PIXELS);
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
    run.state.descent.fix_uncovered(&run.covered);
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

    fn report(&mut self) -> Result<(), Termination> {
        if self.covered.is_empty() || self.described.elapsed() >= DESCRIBE_EVERY {
            self.describe();
        }
        self.tell()
    }

    /// Reports the estimate as it was described last.
    fn tell(&mut self) -> Result<(), Termination> {
        let state = &self.state;
        self.monitor
            .report(&self.estimate, &|progress| Checkpoint::new(progress, state))
    }
}
