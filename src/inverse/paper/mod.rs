//! The stochastic gradient descent of the paper (Azinović et al. 2019): ADAM on small batches of pixels, first per
//! object, then per triangle with the lights in place.

pub mod adam;
pub mod descent;
mod schedule;

use crate::error;
use crate::inverse::estimate::{Estimate, ObjectEstimate, TexelEstimate};
use crate::inverse::loss::LossProbe;
use crate::inverse::monitor::Monitor;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Checkpoint, Problem, Solution, Stage, Termination};
use crate::inverse::survey::Survey;
use crate::scene::Scene;
use crate::scene::texels::TexelLayout;
use crate::transport::material::TexelColors;
use descent::{Descent, Grain};
use glam::{DVec3, Vec3};
use schedule::Schedule;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Halvings of the learning rate (and doublings of the samples), after each of which the loss may stand still once.
const HALVINGS: u32 = 7;

/// What a checkpoint holds: everything that decides how the descent goes on.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct State {
    descent: Descent,
    schedule: Schedule,
    /// Seconds and iterations at the start of the present stage.
    stage_started: (f64, u64),
}

/// A descent under way.
struct Run<'a, 'o> {
    problem: &'a Problem,
    monitor: Monitor<'o>,
    survey: Survey,
    /// For each object why the photographs tell nothing of it; empty where they do.
    notes: Vec<&'static str>,
    losses: LossProbe,
    bounces: u32,
    state: State,
    estimate: Estimate,
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
    let survey = Survey::new(problem, settings, 400_000);
    let bounces = settings.max_bounces();
    let mut state = match resume {
        None => State {
            descent: Descent::new(problem, Grain::Objects),
            schedule: Schedule::default(),
            stage_started: (0.0, 0),
        },
        Some(checkpoint) => checkpoint.state(|state: &State| {
            state.descent.fits(&problem.scene) && state.descent.halvings <= HALVINGS
        })?,
    };
    let notes = untold(problem, &survey);
    state.descent.hold(&problem.scene, &monitor.known);
    let mut run = Run {
        estimate: describe(problem, &survey, &notes, &state.descent),
        losses: LossProbe::new(problem, settings, 400, 16, bounces),
        problem,
        monitor,
        survey,
        notes,
        bounces,
        state,
    };
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
    /// Descends per object, then per triangle.
    fn descend(&mut self) -> Result<Termination, Termination> {
        loop {
            let (name, why) = match self.state.descent.grain {
                Grain::Objects => ("objects", "one albedo and one emission an object"),
                Grain::Triangles => (
                    "triangles",
                    "one albedo a triangle; lights keep their place and value",
                ),
            };
            self.monitor
                .phase(&format!("descending per {}", name.trim_end_matches('s')));
            let ended = self.stage();
            self.finish_stage(name, why);
            ended?;
            let scene = &self.problem.scene;
            let finer = scene.triangles.len() > scene.objects.len();
            if self.state.descent.grain == Grain::Triangles || !finer {
                return Ok(Termination::Converged);
            }
            self.state = State {
                descent: self.state.descent.refine(self.problem),
                schedule: Schedule::default(),
                stage_started: (self.monitor.seconds(), self.monitor.progress.iterations),
            };
        }
    }

    /// Descends until the loss stands still.
    fn stage(&mut self) -> Result<(), Termination> {
        loop {
            // Step until the observer is due, measuring now and then.
            let settings = self.monitor.settings.clone();
            while !self.monitor.due() {
                let iterations = self.monitor.progress.iterations;
                if settings.steps > 0 && iterations >= settings.steps {
                    self.measure();
                    return Err(Termination::Steps);
                }
                if self.state.schedule.due() {
                    let loss = self.measure();
                    if self.state.schedule.measured(loss) {
                        if !settings.anneal || self.state.descent.halvings >= HALVINGS {
                            return Ok(());
                        }
                        self.state.descent.halvings += 1;
                        self.state.schedule.start_over();
                    }
                }
                let outcome = (self.state.descent).step(self.problem, &settings, self.bounces);
                (self.state.descent).hold(&self.problem.scene, &self.monitor.known);
                self.state.schedule.traced(outcome.paths);
                self.monitor.cast(outcome.cast);
                if !outcome.finite {
                    self.describe();
                    return Err(Termination::Diverged);
                }
                self.monitor.progress.iterations += 1;
            }
            self.describe();
            self.monitor
                .progress
                .seconds_to_first_estimate
                .get_or_insert(self.monitor.seconds());
            let state = &self.state;
            self.monitor
                .report(&self.estimate, &|progress| Checkpoint::new(progress, state))?;
        }
    }

    fn describe(&mut self) {
        self.estimate = describe(self.problem, &self.survey, &self.notes, &self.state.descent);
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

    /// Adds a point to the loss curve; returns the loss in the fit.
    fn measure(&mut self) -> Option<f64> {
        self.describe();
        let loss = self.losses.measure(self.problem, &self.estimate);
        self.monitor.cast(loss.cast);
        self.monitor.loss(loss.train, loss.held_out);
        loss.train
    }

    /// Records the stage; one that an earlier run had broken off takes the place of its first part.
    fn finish_stage(&mut self, name: &str, why: &str) {
        let (seconds, iterations) = self.state.stage_started;
        let progress = &mut self.monitor.progress;
        progress.stages.retain(|stage| stage.name != name);
        let last = progress.losses.last().copied();
        self.monitor.stage(Stage {
            name: name.to_owned(),
            seconds: self.monitor.seconds() - seconds,
            iterations: self.monitor.progress.iterations.saturating_sub(iterations),
            train_loss: last.and_then(|l| l.train),
            held_out_loss: last.and_then(|l| l.held_out),
            kept: true,
            why: why.to_owned(),
        });
    }
}

/// For each object why the photographs tell nothing of it; empty where they do.
fn untold(problem: &Problem, survey: &Survey) -> Vec<&'static str> {
    let mut lit = false;
    let mut measured = vec![false; problem.scene.objects.len()];
    for pixel in survey.pixels.iter().filter(|p| !p.held_out) {
        let photograph = &problem.photographs[pixel.frame as usize];
        let radiance = photograph.pixels[pixel.pixel as usize];
        lit |= radiance.max_element() > 0.0;
        if let Some(measured) = measured.get_mut(pixel.object as usize) {
            *measured |= !photograph.is_saturated(pixel.pixel as usize);
        }
    }
    (survey.seen.iter().zip(measured))
        .map(|(&seen, measured)| match (seen, measured) {
            (0, _) => "no photograph sees it",
            (_, false) => "all of its pixels are saturated or held out",
            _ if !lit => "the photographs show no light",
            _ => "",
        })
        .collect()
}

/// The estimate of the present parameters. The paper's descent knows no errors: they are reported as the width of
/// the range, and nothing is claimed to be unidentifiable but what `notes` say.
fn describe(problem: &Problem, survey: &Survey, notes: &[&str], descent: &Descent) -> Estimate {
    let scene = &problem.scene;
    let unknowns = &descent.unknowns;
    let objects = (0..scene.objects.len())
        .map(|k| {
            let seen = survey.seen[k];
            let (albedo, emission) = match descent.grain {
                Grain::Objects => (unknowns.albedo[k], unknowns.emission[k]),
                Grain::Triangles => (mean_albedo(scene, k, &unknowns.albedo), descent.lights[k]),
            };
            ObjectEstimate {
                albedo,
                albedo_stderr: Vec3::ONE,
                emission,
                emission_stderr: emission.max(Vec3::splat(emission.max_element())),
                seen_pixels: seen,
                identifiable: notes[k].is_empty(),
                albedo_identifiable: notes[k].is_empty(),
                note: notes[k].to_owned(),
                ..Default::default()
            }
        })
        .collect();
    let texels = (descent.grain == Grain::Triangles).then(|| {
        let layout = TexelLayout::new(vec![0; scene.triangles.len()]);
        let count = scene.triangles.len();
        Arc::new(TexelEstimate {
            colors: Arc::new(TexelColors {
                layout,
                colors: unknowns.albedo.clone(),
            }),
            stderr: vec![Vec3::ONE; count],
            seen: vec![0; count],
            textured: vec![true; scene.objects.len()],
        })
    });
    Estimate {
        objects,
        texels,
        ..Default::default()
    }
}

/// Area-weighted mean over an object's triangles.
fn mean_albedo(scene: &Scene, object: usize, albedo: &[Vec3]) -> Vec3 {
    let object = &scene.objects[object];
    let sum: DVec3 = (object.triangles.iter())
        .map(|&t| albedo[t as usize].as_dvec3() * f64::from(scene.areas[t as usize]))
        .sum();
    if object.area > 0.0 {
        (sum / object.area).as_vec3()
    } else {
        Vec3::ZERO
    }
}
