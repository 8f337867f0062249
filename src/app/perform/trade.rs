//! Measuring the trade of speed for exactness, and stopping where a person chose on it.

use crate::app::state::App;
use crate::app::task::{Progress, Task};
use crate::app::trade::{Stop, taken_over};
use crate::error::Result;
use crate::inverse::settings::Settings;
use crate::session::command::Command;
use crate::session::snapshot::{Level, OpenCapture};
use crate::study::trade::{Curve, SolveEvent, Trade, measure, plan};
use std::sync::Arc;
use std::time::{Duration, Instant};

impl App {
    /// Whether a measurement could begin: something is open and no solve runs.
    pub(super) fn can_measure(&self) -> bool {
        self.document.capture().is_some() && !self.document.is_running()
    }

    /// Begins to measure the open capture's trade, or ends it, keeping what is measured.
    pub(super) fn measure_or_cancel(&mut self, ctx: &egui::Context) {
        if let Some((_, task)) = &self.jobs.measured.measuring {
            return task.cancel();
        }
        let Some(capture) = self.document.capture().filter(|_| self.can_measure()) else {
            return;
        };
        let (seed, limit) = (self.document.settings.seed, self.view.panels.trade.limit);
        let limit = Duration::try_from_secs_f64(limit).unwrap_or(Duration::MAX);
        let [capture, measured] = [capture.clone(), capture.clone()];
        let run = move |progress: &Progress<_>| run(progress, &measured, seed, limit);
        match Task::begin("trade", ctx, run) {
            Ok(task) => self.jobs.measured.measuring = Some((capture, task)),
            Err(error) => self.say(Level::Error, error.to_string()),
        }
    }

    /// Takes in what was measured; a solve that begins ends the measurement, since each would slow the other.
    pub(in crate::app) fn take_trade(&mut self) {
        let measured = &mut self.jobs.measured;
        let Some((capture, task)) = &mut measured.measuring else {
            return;
        };
        if self.document.is_running() {
            task.cancel();
        }
        let current = self.document.capture();
        let same = current.is_some_and(|current| Arc::ptr_eq(current, capture));
        let newest = task.newest().filter(|_| same);
        let end = task.end();
        if newest.is_some() {
            (measured.trade, measured.unsaved) = (newest, true);
        }
        if let Some(end) = end {
            measured.measuring = None;
            if let Err(message) = end {
                self.say(Level::Error, message);
            }
        }
    }

    /// Forgets the trade of the capture before and reads that of the one that is open now.
    pub(in crate::app) fn trade_of_capture(&mut self) {
        let measured = &mut self.jobs.measured;
        if let Some((_, task)) = &measured.measuring {
            task.cancel();
        }
        (measured.trade, measured.unsaved) = (None, false);
        if let Some(capture) = self.document.capture()
            && let Err(message) = measured.load(&capture.source.default_out(), capture)
        {
            self.say(Level::Warning, message);
        }
    }

    /// Writes the trade where it is found again when the capture is opened next.
    pub(super) fn keep_trade(&mut self) {
        let trade = self.jobs.measured.trade.as_ref();
        let Some((trade, capture)) = trade.zip(self.document.capture()) else {
            return;
        };
        let folder = capture.source.default_out();
        if let Err(error) = trade.write(&folder) {
            return self.say(Level::Error, error.to_string());
        }
        self.jobs.measured.unsaved = false;
        let message = format!("trade written to {}", folder.display());
        self.say(Level::Info, message);
    }

    /// Takes over a curve's parameters, as far as they differ from the defaults, and stops where it was chosen.
    pub(super) fn choose_stop(&mut self, curve: usize, stop: Stop) {
        let trade = self.jobs.measured.trade.as_ref();
        let Some(curve) = trade.and_then(|trade| trade.curves.get(curve)) else {
            return;
        };
        let before = &self.document.settings;
        let mut settings = taken_over(before, &curve.settings);
        (settings.target_error, settings.time) = match stop {
            Stop::Error(percent) => (percent, 0.0),
            Stop::Seconds(seconds) => (0.0, seconds),
        };
        let mut message = format!("{} with {}", stop.words(), curve.name);
        let begun = !self.document.snapshot.progress.phase.is_empty();
        if settings.preset != before.preset && begun {
            message += ": the preset is changed, which takes effect at the next reset";
        }
        self.say(Level::Info, message);
        self.document.settings = settings.clone();
        self.send(Command::Set(Box::new(settings)));
    }
}

fn run(
    progress: &Progress<Arc<Trade>>,
    capture: &OpenCapture,
    seed: u64,
    limit: Duration,
) -> Result<()> {
    progress.say("reading the truth, if there is one");
    let subject = capture.subject()?;
    let runs = plan::presets(&Settings {
        seed,
        ..Settings::default()
    });
    let (begun, hash, metric) = (Instant::now(), &capture.hash, &subject.metric);
    let mut curves: Vec<Curve> = Vec::new();
    let mut tell = |heard: SolveEvent| match heard {
        SolveEvent::Begins(run) => progress.say(format!("measuring {}", run.name)),
        SolveEvent::Ended(curve) => {
            curves.push(curve.clone());
            let (hash, measure, curves) = (Some(hash.clone()), metric.measure(), curves.clone());
            let trade = Trade::new(&subject.name, hash, measure, begun.elapsed(), curves);
            progress.show(Arc::new(trade));
        }
    };
    let ended = || progress.is_cancelled();
    measure(&subject.problem, metric, &runs, limit, &ended, &mut tell)?;
    Ok(())
}
