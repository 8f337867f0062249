//! `relit solve`: a headless solve with progress and a table at its end; an interrupt saves the estimate reached so far.

use crate::cli::interrupt::Interrupt;
use crate::cli::object_values::ObjectValues;
use crate::cli::options::{SolveOptions, use_threads};
use crate::cli::progress::Meter;
use crate::error::Result;
use crate::export::overwrite::CaptureId;
use crate::inverse::estimate::{Estimate, ObjectEstimate};
use crate::inverse::known::Known;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Checkpoint, Control, Observer, Progress, Termination};
use crate::say;
use crate::scene::Scene;
use crate::session::command::Source;
use crate::session::edits::Edits;
use crate::session::open::open;
use crate::session::save::staging::Staging;
use crate::session::save::{self, Results};
use glam::Vec3;
use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Message of an interrupt before there is an estimate.
const NOTHING_TO_SAVE: &str = "interrupted before there was anything to save";

/// Solves a source and writes the results. Returns the exit code.
pub fn solve(source: &Source, options: &SolveOptions, known: &ObjectValues) -> Result<i32> {
    let started = Instant::now();
    options.replace.apply();
    use_threads(options.threads)?;
    let interrupt = Interrupt::listen()?;

    // Load the earlier solve.
    let folder = options.out.clone().unwrap_or_else(|| source.default_out());
    let earlier = (options.resume.then(|| save::load_checkpoint(&folder))).transpose()?;
    let base = earlier.as_ref().map(|e| e.settings.clone());
    let settings = options.parameters.over(&base.unwrap_or_default());

    // Read the capture.
    let read = match &earlier {
        Some(earlier) => options.read.over(earlier.options.clone()),
        None => options.read.open(&settings),
    };
    let capture = Arc::new(open(source, &read)?.aligned()?);
    let seconds_load = started.elapsed().as_secs_f64();
    let summary = capture.summary.join(", ");
    say::note(format_args!("{}: {summary}", capture.name));
    for warning in &capture.warnings {
        say::warning(warning);
    }
    let mut edits = Edits::default();
    if let Some(earlier) = &earlier {
        earlier.estimate_for(&capture)?;
        edits = earlier.edits_for(&capture)?;
        if earlier.checkpoint.is_none() {
            say::warning("the earlier solve left no checkpoint; starting over");
        }
    }
    let checkpoint = earlier.as_ref().and_then(|e| e.checkpoint.as_ref());
    known.add(&capture.scene, &mut edits, true)?;

    if let Some(checkpoint) = checkpoint
        && settings.time > 0.0
        && checkpoint.progress.seconds >= settings.time
    {
        say::warning(format_args!(
            "--time counts from the start of the earlier solve, which took {:.1} s; give more to go on",
            checkpoint.progress.seconds
        ));
    }

    // Check before the solve, not after it, that the results can be written.
    drop(Staging::new(&folder, &CaptureId::from(capture.as_ref()))?);

    // Solve.
    if interrupt.requested() {
        say::note(NOTHING_TO_SAVE);
        return Ok(interrupt.exit_code());
    }
    let problem = capture.problem();
    let mut watch = Watch {
        results: Results {
            capture: capture.clone(),
            settings: settings.clone(),
            estimate: Arc::default(),
            edits,
            progress: Arc::default(),
            stopped_because: None,
            checkpoint: checkpoint.cloned(),
            views: options.views.unwrap_or_default(),
            renderer: options.device.renderer()?,
            denoiser: options.denoise.denoiser(true)?,
            started,
            seconds_load,
        },
        folder: &folder,
        settings: &settings,
        interrupt: &interrupt,
        meter: Meter::new(),
        every: options.checkpoint,
        pending: None,
        written: Instant::now(),
    };
    let solution = crate::inverse::solve(&problem, &settings, checkpoint, &mut watch);
    watch.meter.finish();
    let solution = solution?;

    // Write.
    if interrupt.requested() {
        // Before the first loss the estimate is the initial guess, and must not replace earlier results.
        if solution.progress.losses.is_empty() {
            say::note(NOTHING_TO_SAVE);
            return Ok(interrupt.exit_code());
        }
        say::note("interrupted: saving what there is (again Ctrl-C to abort)");
    }
    let results = Results {
        estimate: Arc::new(capture.marked_doubtful(solution.estimate)),
        progress: Arc::new(solution.progress),
        stopped_because: Some(solution.termination),
        checkpoint: solution.checkpoint,
        ..watch.results
    };
    save::write(&folder, &results)?;
    for warning in &results.progress.warnings {
        say::warning(warning);
    }
    say::table(&objects(&capture.scene, &results.estimate));
    say::line("");
    say::line(ending(&results.progress, solution.termination));
    say::line(format_args!("results in {}", folder.display()));
    Ok(interrupt.exit_code())
}

/// Observer of the solver: shows progress, writes checkpoints, and stops at an interrupt.
struct Watch<'a> {
    results: Results,
    folder: &'a Path,
    settings: &'a Settings,
    interrupt: &'a Interrupt,
    meter: Meter,
    /// Time between two checkpoints.
    every: Duration,
    /// The checkpoint to write at the next report.
    pending: Option<Checkpoint>,
    written: Instant,
}

impl Observer for Watch<'_> {
    fn known(&self) -> Known {
        self.results.edits.known()
    }

    fn observe(&mut self, progress: &Progress, estimate: &Estimate) -> Control {
        self.meter.show(progress, self.settings);
        if let Some(checkpoint) = self.pending.take() {
            self.results.checkpoint = Some(checkpoint);
            self.results.estimate = Arc::new(estimate.clone());
            self.results.progress = Arc::new(progress.clone());
            // A checkpoint that cannot be written does not end the solve.
            if let Err(error) = save::write_checkpoint(self.folder, &self.results) {
                self.meter.say(&format!("warning: {error}"));
            }
            self.written = Instant::now();
        }
        if self.interrupt.requested() {
            return Control::Stop;
        }
        Control::Continue
    }

    fn offer(&mut self, make: &dyn Fn() -> Checkpoint) {
        if self.written.elapsed() >= self.every {
            self.pending = Some(make());
        }
    }
}

/// Most rows printed; report.json has all.
const ROWS: usize = 24;

/// Table of objects with standard errors, sorted by emission, then by the number of pixels that see them.
fn objects(scene: &Scene, estimate: &Estimate) -> String {
    let names = scene.objects.iter().map(|o| say::plain(&o.name));
    let mut rows: Vec<(Cow<str>, &ObjectEstimate)> = names.zip(&estimate.objects).collect();
    rows.sort_by(|(_, a), (_, b)| {
        let brightness = |o: &ObjectEstimate| o.emission.element_sum();
        brightness(b)
            .total_cmp(&brightness(a))
            .then(b.seen_pixels.cmp(&a.seen_pixels))
    });
    let shown = rows.len().min(ROWS);
    let widths = rows[..shown].iter().map(|(name, _)| name.chars().count());
    let width = widths.max().unwrap_or(0).max(6);
    let mut text = format!(
        "{:width$}  {:>24}  {:>9}  {:>17}  {:>7}  {:>8}\n",
        "object", "emission", "±", "albedo", "±", "pixels"
    );
    for (name, object) in &rows[..shown] {
        let [r, g, b] = object.emission.to_array();
        let emission = format!("{r:.4} {g:.4} {b:.4}");
        let [r, g, b] = object.albedo.to_array();
        let albedo = match object.albedo_identifiable {
            true => format!("{r:.3} {g:.3} {b:.3}"),
            false => "not determined".to_owned(),
        };
        let emission_error = error(object.emission_stderr, 4);
        let (albedo_error, pixels) = (error(object.albedo_stderr, 3), object.seen_pixels);
        text += &format!("{name:width$}  {emission:>24}  {emission_error:>9}  ");
        text += &format!("{albedo:>17}  {albedo_error:>7}  {pixels:>8}\n");
    }
    if estimate.common_error > 0.0 {
        text += &format!(
            "one factor of all albedos together is known to ±{:.0} %; their ratios are known better\n",
            estimate.common_error * 100.0
        );
    }
    if rows.len() > shown {
        text += &format!("… and {} more in report.json\n", rows.len() - shown);
    }
    text
}

fn error(stderr: Vec3, digits: usize) -> String {
    let worst = stderr.max_element();
    // f32::MAX stands for an unknown error.
    match worst < f32::MAX {
        true => format!("{worst:.digits$}"),
        false => "?".to_owned(),
    }
}

/// One line on why and when the solve ended.
fn ending(progress: &Progress, termination: Termination) -> String {
    let why = match termination {
        Termination::Converged => "converged",
        Termination::Target => "the target error is reached",
        Termination::Time => "the time is up",
        Termination::Steps => "the steps are done",
        Termination::Cancelled => "stopped",
        Termination::Diverged => "diverged; this is the last finite estimate",
    };
    format!(
        "{why} after {:.1} s, {} iterations, {:.1} million rays",
        progress.seconds,
        progress.iterations,
        progress.rays as f64 * 1e-6
    )
}
