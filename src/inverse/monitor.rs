//! The solver's clock and its line to the observer.

use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{
    Checkpoint, Control, LossPoint, Observer, Progress, Stage, Termination,
};
use std::time::{Duration, Instant};

/// Counts time without pauses, reports to the observer, and says when to stop.
pub struct Monitor<'a> {
    observer: &'a mut dyn Observer,
    /// What the observer hears.
    pub progress: Progress,
    /// The parameters in force; live ones may change at any report.
    pub settings: Settings,
    started: Instant,
    /// Time spent in the observer.
    away: Duration,
    /// Seconds of the runs before this one.
    earlier: f64,
    last_report: Option<Instant>,
}

/// Reports further apart than this are due.
const REPORT_EVERY: Duration = Duration::from_millis(30);

impl<'a> Monitor<'a> {
    /// Starts the clock at the seconds that `progress` already has.
    pub fn new(settings: &Settings, observer: &'a mut dyn Observer, progress: Progress) -> Self {
        Self {
            observer,
            earlier: progress.seconds,
            progress,
            settings: settings.clone(),
            started: Instant::now(),
            away: Duration::ZERO,
            last_report: None,
        }
    }

    /// Seconds of solving so far.
    pub fn seconds(&self) -> f64 {
        self.earlier + (self.started.elapsed().saturating_sub(self.away)).as_secs_f64()
    }

    /// Whether a report is due.
    pub fn due(&self) -> bool {
        self.last_report
            .is_none_or(|at| at.elapsed() >= REPORT_EVERY)
    }

    /// Tells the observer, if a report is due, and obeys; the error says why to stop.
    pub fn tick(
        &mut self,
        estimate: &Estimate,
        checkpoint: &dyn Fn(&Progress) -> Checkpoint,
    ) -> Result<(), Termination> {
        if self.due() {
            self.report(estimate, checkpoint)?;
        }
        Ok(())
    }

    /// Tells the observer now; `checkpoint` is called only if the observer wants to keep one.
    pub fn report(
        &mut self,
        estimate: &Estimate,
        checkpoint: &dyn Fn(&Progress) -> Checkpoint,
    ) -> Result<(), Termination> {
        self.progress.seconds = self.seconds();
        let called = Instant::now();
        let progress = &self.progress;
        self.observer.offer(&|| checkpoint(progress));
        let control = self.observer.observe(&self.progress, estimate);
        self.away += called.elapsed();
        self.last_report = Some(Instant::now());
        match control {
            Control::Continue => {}
            Control::Change(settings) => self.settings = *settings,
            Control::Stop => return Err(Termination::Cancelled),
        }
        if self.settings.time > 0.0 && self.seconds() >= self.settings.time {
            return Err(Termination::Time);
        }
        Ok(())
    }

    /// Names what is being done now.
    pub fn phase(&mut self, name: &str) {
        name.clone_into(&mut self.progress.phase);
        self.progress.fraction = None;
    }

    /// Adds a point to the loss curve.
    pub fn loss(&mut self, train: Option<f64>, held_out: Option<f64>) {
        let point = LossPoint {
            seconds: self.seconds(),
            iteration: self.progress.iterations,
            train,
            held_out,
        };
        self.progress.losses.push(point);
    }

    /// Records a finished stage.
    pub fn stage(&mut self, stage: Stage) {
        self.progress.stages.push(stage);
    }

    /// Counts dropped samples.
    pub fn rejected(&mut self, cause: &str, count: u64) {
        if count > 0 {
            *self.progress.rejected.entry(cause.to_owned()).or_default() += count;
        }
    }
}
