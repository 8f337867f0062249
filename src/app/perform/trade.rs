//! Measuring the trade of speed for exactness, and stopping where a person chose on it.

use crate::app::state::App;
use crate::app::trade::choice::{Stop, taken_over};
use crate::app::trade::measuring::Measuring;
use crate::session::command::Command;
use crate::session::snapshot::Level;
use std::sync::Arc;

impl App {
    /// Whether a measurement could begin: something is open and no solve runs.
    pub(super) fn can_measure(&self) -> bool {
        self.document.capture().is_some() && !self.document.is_running()
    }

    /// Begins to measure the open capture's trade, or ends it, keeping what is measured.
    pub(super) fn measure_or_cancel(&mut self, ctx: &egui::Context) {
        if let Some(measuring) = &self.jobs.measured.measuring {
            return measuring.task.cancel();
        }
        let Some(capture) = self.document.capture().filter(|_| self.can_measure()) else {
            return;
        };
        let ctx = ctx.clone();
        let wake = move || ctx.request_repaint();
        let (seed, limit) = (self.document.settings.seed, self.view.panels.trade.limit.0);
        match Measuring::begin(capture.clone(), seed, limit, wake) {
            Ok(measuring) => self.jobs.measured.measuring = Some(measuring),
            Err(error) => self.say(Level::Error, error.to_string()),
        }
    }

    /// Takes in what was measured; a solve that begins ends the measurement, since each would slow the other.
    pub(in crate::app) fn take_trade(&mut self) {
        let measured = &mut self.jobs.measured;
        let Some(measuring) = &mut measured.measuring else {
            return;
        };
        if self.document.is_running() {
            measuring.task.cancel();
        }
        let current = self.document.capture();
        let same = current.is_some_and(|c| Arc::ptr_eq(c, &measuring.capture));
        let newest = measuring.task.newest().filter(|_| same);
        let end = measuring.task.end();
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
        if let Some(measuring) = &measured.measuring {
            measuring.task.cancel();
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
