//! Courses of solves that studies compare: the paper's descent, at fixed numbers of rays, and the end of the transport cache.

use crate::error::Result;
use crate::inverse::estimate::{Estimate, ObjectEstimate};
use crate::inverse::loss::LossProbe;
use crate::inverse::paper::descent::{Descent, StepOutcome};
use crate::inverse::settings::{Preset, Settings};
use crate::inverse::solver::Solution;
use crate::study::experiments::study::{Bench, Limits};
use crate::study::subject::Subject;
use crate::study::trade::plan::Run;
use crate::study::trade::watch;
use crate::transport::material::Lobe;
use std::time::{Duration, Instant};

/// Rays at the first mark.
const FIRST: f64 = 20_000.0;
/// Factor in rays between marks.
const FACTOR: f64 = std::f64::consts::SQRT_2;
/// Held-out pixels that are rendered for the loss.
const PIXELS: usize = 400;
/// Samples for each of these pixels.
const SAMPLES: u64 = 64;
/// Time limit of a solve.
const PATIENCE: Duration = Duration::from_secs(600);

/// Measurement of a solve in progress.
#[derive(Debug, Clone)]
pub struct Mark {
    /// Number of the last mark passed, the same for all solves. `None` before the first.
    pub index: Option<u32>,
    pub rays: u64,
    /// Seconds of solving, without measurements.
    pub seconds: f64,
    pub steps: u64,
    pub errors: Errors,
}

#[derive(Debug, Clone, Copy, Default)]
pub struct Errors {
    /// Mean absolute difference in radiance on held-out pixels.
    pub loss: Option<f64>,
    /// Mean absolute error of albedo.
    pub albedo: Option<f64>,
    /// Median relative error of the lamps' emission.
    pub emission: Option<f64>,
    /// Relative error ‖ρ̂ − ρ‖₂ / ‖ρ‖₂ over RGB of the albedo of the watched object.
    pub object: Option<f64>,
}

/// Measures estimates of a subject, always on the same pixels.
pub struct Evaluator<'a> {
    pub subject: &'a Subject,
    pub probe: LossProbe,
    /// The object whose error is told by itself.
    pub watched: Option<&'a str>,
    /// The objects' lobes, where descents know them.
    pub lobes: Vec<Option<Lobe>>,
}

impl<'a> Evaluator<'a> {
    /// A gauge that renders at most `bounces` bounces.
    pub fn new(subject: &'a Subject, bounces: u32) -> Self {
        let settings = Settings::default();
        let probe = LossProbe::new(&subject.problem, &settings, PIXELS, SAMPLES, bounces);
        Self {
            subject,
            probe,
            watched: None,
            lobes: Vec::new(),
        }
    }

    pub fn errors(&self, estimate: &Estimate) -> Errors {
        let known =
            (self.subject.truth()).map(|truth| truth.errors(&self.subject.problem.scene, estimate));
        Errors {
            loss: self.probe.held_out(&self.subject.problem, estimate).0,
            albedo: known.as_ref().and_then(|known| known.albedo_mae),
            object: known.as_ref().and_then(|known| {
                let mut objects = known.per_object.iter();
                let watched = objects.find(|(name, _)| Some(name.as_str()) == self.watched);
                watched?.1.albedo_rel
            }),
            emission: known.and_then(|known| known.emission_rel_median),
        }
    }
}

/// Runs the descent as published, per object and without annealing, and measures it whenever its rays pass a mark.
///
/// The rays cast, and so all errors at a mark, depend only on the settings; how many marks are reached in limited
/// time does not. Ends when a parameter is not finite, or the study is stopped.
pub fn descend(bench: &Bench, gauge: &Evaluator, settings: &Settings, limits: Limits) -> Vec<Mark> {
    let problem = &gauge.subject.problem;
    let mut step = |descent: &mut Descent| descent.step(problem, settings, settings.max_bounces());
    let start = Descent::new(problem).with_lobes(gauge.lobes.clone());
    descend_by(bench, gauge, start, limits, &mut step)
}

/// The same from a given start and with given steps.
pub fn descend_by(
    bench: &Bench,
    gauge: &Evaluator,
    start: Descent,
    limits: Limits,
    step: &mut dyn FnMut(&mut Descent) -> StepOutcome,
) -> Vec<Mark> {
    let mut descent = start;
    let (mut rays, mut steps, mut seconds) = (0, 0, 0.0);
    let mut marks = Vec::new();
    loop {
        let goal = rays_at(mark_at(rays).map_or(0, |mark| mark + 1)).min(limits.rays);
        let begun = Instant::now();
        let mut over = false;
        while rays < goal && !over {
            let outcome = step(&mut descent);
            rays += outcome.cast.rays;
            steps += 1;
            let late = seconds + begun.elapsed().as_secs_f64() >= limits.seconds;
            over = late || !outcome.finite || outcome.cast.rays == 0 || (bench.stopped)();
        }
        seconds += begun.elapsed().as_secs_f64();

        marks.push(Mark {
            index: mark_at(rays),
            rays,
            seconds,
            steps,
            errors: gauge.errors(&estimate(&descent)),
        });
        if over || rays >= limits.rays {
            return marks;
        }
    }
}

/// Number of rays at a mark.
pub fn rays_at(mark: u32) -> u64 {
    (FIRST * FACTOR.powi(mark as i32)) as u64
}

/// The last mark at or below a number of rays.
fn mark_at(rays: u64) -> Option<u32> {
    (0..).take_while(|&mark| rays_at(mark) <= rays).last()
}

/// The current state of a descent as an estimate.
pub fn estimate(descent: &Descent) -> Estimate {
    let values = descent.albedo.iter().zip(&descent.emission);
    Estimate {
        objects: (values.enumerate())
            .map(|(object, (&albedo, &emission))| ObjectEstimate {
                albedo,
                emission,
                roughness: descent.lobe(object).map(|lobe| lobe.roughness),
                specular: descent.lobe(object).map(|lobe| lobe.specular.x),
                ..ObjectEstimate::default()
            })
            .collect(),
        ..Estimate::default()
    }
}

/// Solves with the transport cache and measures its end; fails as [`solved`].
pub fn cached(bench: &Bench, gauge: &Evaluator, settings: &Settings) -> Result<Mark> {
    let solution = solved(bench, gauge.subject, settings)?;
    Ok(Mark {
        index: None,
        rays: solution.progress.rays,
        seconds: solution.progress.seconds,
        steps: solution.progress.iterations,
        errors: gauge.errors(&solution.estimate),
    })
}

/// Solves like the program, with the solver of the settings' preset.
///
/// # Errors
/// The solver cannot start, or the study is stopped.
pub fn solved(bench: &Bench, subject: &Subject, settings: &Settings) -> Result<Solution> {
    let run = Run {
        name: settings.preset.word().to_owned(),
        is_preset: false,
        settings: settings.clone(),
        weight: 1.0,
    };
    let deadline = Instant::now() + PATIENCE;
    let (problem, metric) = (&subject.problem, &subject.metric);
    let (_, solution) = watch(problem, metric, &run, deadline, bench.stopped)?;
    bench.go_on()?;
    Ok(solution)
}

/// How [`cache_settings`] differ from the program's defaults, as a phrase.
pub const CACHE_WITHOUT: &str = "exposures, the test for photographs that disagree, light from outside, lobes and textures \
                                 switched off";

/// The transport cache's settings in studies: the default preset, or the fastest if `quick`.
pub fn cache_settings(seed: u64, quick: bool) -> Settings {
    Settings {
        preset: if quick {
            Preset::Preview
        } else {
            Preset::Balanced
        },
        seed,
        exposures: false,
        textures: false,
        lobes: false,
        outside_light: false,
        leave_out: false,
        ..Settings::default()
    }
}

pub fn paper_settings(seed: u64) -> Settings {
    Settings {
        preset: Preset::Paper,
        seed,
        ..Settings::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_passed_in_order() {
        assert_eq!(mark_at(rays_at(0) - 1), None);
        for mark in 0..40 {
            assert_eq!(mark_at(rays_at(mark)), Some(mark));
            assert_eq!(mark_at(rays_at(mark + 1) - 1), Some(mark));
        }
    }
}
