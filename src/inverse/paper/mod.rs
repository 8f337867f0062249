//! The stochastic gradient descent of the paper (Azinović et al. 2019): ADAM on small batches of pixels, first per
//! object, then per triangle with the lights in place.

pub mod adam;
pub mod descent;

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
use std::sync::Arc;

/// Seconds between two measurements of the loss.
const MEASURE_EVERY: f64 = 1.0;
/// The loss stands still when the mean of this many measurements is no better than that of as many before, by a share.
const WINDOW: usize = 4;
const STANDSTILL: f64 = 0.01;
/// Halvings of the learning rate (and doublings of the batch), after each of which the loss may stand still once.
const HALVINGS: u32 = 7;
/// Bounces where the settings leave the choice.
const BOUNCES: u32 = 2;

/// Runs the paper's optimiser until time, steps or a standstill end it.
///
/// # Errors
/// The checkpoint belongs to another capture.
pub fn solve(
    problem: &Problem,
    settings: &Settings,
    resume: Option<&Checkpoint>,
    mut monitor: Monitor,
) -> error::Result<Solution> {
    let survey = Survey::new(problem, settings, 400_000);
    let bounces = if settings.bounces == 0 {
        BOUNCES
    } else {
        settings.bounces as u32
    };
    let losses = LossProbe::new(problem, settings, 400, 16, bounces);
    let mut descent = match resume {
        None => Descent::new(problem, Grain::Objects),
        Some(checkpoint) => serde_json::from_value(checkpoint.state.clone())
            .ok()
            .filter(|d: &Descent| d.fits(&problem.scene))
            .ok_or_else(|| {
                error::Error::new(
                    "checkpoint",
                    "belongs to another capture or solver",
                    "start a new solve",
                )
            })?,
    };
    let mut estimate = describe(problem, &survey, &descent);
    let termination = match run(
        problem,
        &survey,
        &losses,
        bounces,
        &mut descent,
        &mut estimate,
        &mut monitor,
    ) {
        Ok(termination) | Err(termination) => termination,
    };
    monitor.phase("done");
    monitor.progress.seconds = monitor.seconds();
    let checkpoint = serde_json::to_value(&descent)
        .ok()
        .map(|state| Checkpoint { state });
    Ok(Solution {
        estimate,
        progress: monitor.progress,
        termination,
        checkpoint,
    })
}

fn run(
    problem: &Problem,
    survey: &Survey,
    losses: &LossProbe,
    bounces: u32,
    descent: &mut Descent,
    estimate: &mut Estimate,
    monitor: &mut Monitor,
) -> Result<Termination, Termination> {
    loop {
        let (name, why) = match descent.grain {
            Grain::Objects => ("objects", "one albedo and one emission an object"),
            Grain::Triangles => (
                "triangles",
                "one albedo a triangle; lights keep their place and value",
            ),
        };
        monitor.phase(&format!("descending per {}", name.trim_end_matches('s')));
        let started = (monitor.seconds(), monitor.progress.iterations);
        let ended = stage(problem, survey, losses, bounces, descent, estimate, monitor);
        let last = monitor.progress.losses.last().copied();
        monitor.stage(Stage {
            name: name.to_owned(),
            seconds: monitor.seconds() - started.0,
            iterations: monitor.progress.iterations - started.1,
            train_loss: last.and_then(|l| l.train),
            held_out_loss: last.and_then(|l| l.held_out),
            kept: true,
            why: why.to_owned(),
        });
        ended?;
        let finer = problem.scene.triangles.len() > problem.scene.objects.len();
        if descent.grain == Grain::Triangles || !finer {
            return Ok(Termination::Converged);
        }
        *descent = descent.refine(problem);
    }
}

/// Descends until the loss stands still.
fn stage(
    problem: &Problem,
    survey: &Survey,
    losses: &LossProbe,
    bounces: u32,
    descent: &mut Descent,
    estimate: &mut Estimate,
    monitor: &mut Monitor,
) -> Result<(), Termination> {
    let mut measured_at = f64::NEG_INFINITY;
    let mut history: Vec<f64> = Vec::new();
    loop {
        // Measure now and then.
        if monitor.seconds() - measured_at >= MEASURE_EVERY {
            *estimate = describe(problem, survey, descent);
            let loss = losses.measure(problem, estimate);
            monitor.progress.rays += loss.rays;
            monitor.loss(loss.train, loss.held_out);
            measured_at = monitor.seconds();
            history.extend(loss.train);
            if stands_still(&history) {
                if !monitor.settings.anneal || descent.halvings >= HALVINGS {
                    return Ok(());
                }
                descent.halvings += 1;
                history.clear();
            }
        }

        // Step until the observer is due.
        let settings = monitor.settings.clone();
        while !monitor.due() {
            let outcome = descent.step(problem, &settings, bounces);
            monitor.progress.rays += outcome.rays;
            monitor.progress.iterations += 1;
            monitor.rejected("path weight not finite", outcome.rejected);
            if !outcome.finite {
                return Err(Termination::Diverged);
            }
            if settings.steps > 0 && monitor.progress.iterations >= settings.steps {
                *estimate = describe(problem, survey, descent);
                let loss = losses.measure(problem, estimate);
                monitor.loss(loss.train, loss.held_out);
                return Err(Termination::Steps);
            }
        }
        *estimate = describe(problem, survey, descent);
        monitor
            .progress
            .seconds_to_first_estimate
            .get_or_insert(monitor.seconds());
        monitor.report(estimate)?;
    }
}

/// Whether the last window of losses is no better than the one before.
fn stands_still(history: &[f64]) -> bool {
    if history.len() < 2 * WINDOW {
        return false;
    }
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    let (before, last) = history[history.len() - 2 * WINDOW..].split_at(WINDOW);
    mean(last) > mean(before) * (1.0 - STANDSTILL)
}

/// The estimate of the present parameters. The paper's descent knows no errors: they are reported as the width of
/// the range, and nothing is claimed to be unidentifiable but what no pixel sees.
fn describe(problem: &Problem, survey: &Survey, descent: &Descent) -> Estimate {
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
                identifiable: seen > 0,
                albedo_identifiable: seen > 0,
                note: if seen == 0 {
                    "no photograph sees it".into()
                } else {
                    String::new()
                },
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
