//! `relit solve`: a headless solve with progress; an interrupt saves the estimate reached so far.

use crate::cli::interrupt::Interrupt;
use crate::cli::object_values::ObjectValues;
use crate::cli::options::SolveOptions;
use crate::cli::progress::Meter;
use crate::cli::report;
use crate::error::{Error, Result};
use crate::export::overwrite::CaptureId;
use crate::inverse::estimate::Estimate;
use crate::inverse::known::Known;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Checkpoint, Control, Observer, Progress};
use crate::say;
use crate::session::command::Source;
use crate::session::edits::Edits;
use crate::session::open::open;
use crate::session::save::staging::Staging;
use crate::session::save::{self, Results};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Message of an interrupt before there is an estimate.
const NOTHING_TO_SAVE: &str = "interrupted before there was anything to save";

/// Solves a source and writes the results. Returns the exit code.
///
/// # Errors
/// The capture cannot be read or solved, or the results cannot be written.
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
    say::table(&report::objects(&capture.scene, &results.estimate));
    say::line("");
    say::line(report::ending(&results.progress, solution.termination));
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

/// More threads per core than this gain nothing: an idle worker scans the list of all threads for work, which takes most of the
/// time with a thousand of them.
const MAX_THREADS_A_CORE: usize = 4;

/// Sets the number of worker threads of the process. Warns if fewer are used than `threads`.
///
/// # Errors
/// The threads cannot be started.
pub fn use_threads(threads: Option<u16>) -> Result<()> {
    let Some(threads) = threads.map(usize::from) else {
        return Ok(());
    };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let used = threads.min(cores * MAX_THREADS_A_CORE);
    if used < threads {
        say::warning(format_args!(
            "--threads {threads}: {used} are used, {MAX_THREADS_A_CORE} for each of the machine's {cores} cores"
        ));
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(used);
    let built = pool.build_global();
    built.map_err(|error| Error::new("--threads", error, "name fewer threads"))
}
