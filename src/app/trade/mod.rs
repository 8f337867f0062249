//! The trade of speed for exactness of the open capture: read from its results or measured here, and what a person
//! chose on it.

pub mod choice;
mod measuring;

use crate::app::state::App;
use crate::session::snapshot::{Level, OpenCapture};
use crate::study::trade::Trade;
use egui::Pos2;
use measuring::Measuring;
use std::path::Path;
use std::sync::Arc;

/// What is plotted over seconds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Vertical {
    /// The relative error that estimates claim of themselves; the paper's descent claims none.
    #[default]
    Claimed,
    /// The error as it was measured.
    Measured,
}

/// The state of the pane.
#[derive(Default)]
pub struct TradeView {
    /// The curves of the open capture, as far as they are known.
    pub trade: Option<Arc<Trade>>,
    /// What is plotted over seconds.
    pub vertical: Vertical,
    /// Seconds that a measurement may take.
    pub limit: Limit,
    /// Where the points were drawn last: place on the screen, curve and point.
    pub places: Vec<(Pos2, usize, usize)>,
    /// Whether the curves were measured here and are in no file yet.
    pub unsaved: bool,
    measuring: Option<Measuring>,
}

/// Seconds that a measurement may take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limit(pub f64);

impl Default for Limit {
    fn default() -> Self {
        Self(120.0)
    }
}

impl TradeView {
    /// Reads the trade in a folder, if there is one and it is this capture's.
    ///
    /// # Errors
    /// The file is broken, or belongs to another capture.
    pub fn load(&mut self, folder: &Path, capture: &OpenCapture) -> Result<(), String> {
        let Some(trade) = Trade::read(folder).map_err(|error| error.to_string())? else {
            return Ok(());
        };
        if trade.hash.as_deref() != Some(capture.hash.as_str()) {
            return Err(format!(
                "{}: trade.json belongs to another capture; measure again",
                folder.display()
            ));
        }
        self.trade = Some(Arc::new(trade));
        self.unsaved = false;
        Ok(())
    }

    /// What is being measured now, in words.
    pub fn doing(&self) -> Option<String> {
        self.measuring.as_ref().map(|m| m.task.doing())
    }
}

impl App {
    /// Whether a measurement could begin: something is open and no solve runs.
    pub fn can_measure(&self) -> bool {
        self.capture().is_some() && !self.is_running()
    }

    /// Begins to measure the open capture's trade, or ends it, keeping what is measured.
    pub fn measure_or_cancel(&mut self, ctx: &egui::Context) {
        if let Some(measuring) = &self.trade.measuring {
            measuring.task.cancel();
            return;
        }
        let Some(capture) = self.capture().filter(|_| self.can_measure()).cloned() else {
            return;
        };
        let ctx = ctx.clone();
        let wake = move || ctx.request_repaint();
        match Measuring::begin(capture, self.settings.seed, self.trade.limit.0, wake) {
            Ok(measuring) => self.trade.measuring = Some(measuring),
            Err(error) => self.notices.say(Level::Error, error.to_string()),
        }
    }

    /// Takes in what was measured; a solve that begins ends the measurement, since each would slow the other.
    pub(in crate::app) fn take_trade(&mut self) {
        let running = self.is_running();
        let Some(measuring) = &mut self.trade.measuring else {
            return;
        };
        if running {
            measuring.task.cancel();
        }
        let current = self.snapshot.capture.as_ref();
        let same = current.is_some_and(|c| Arc::ptr_eq(c, &measuring.capture));
        if let Some(trade) = measuring.task.newest().filter(|_| same) {
            self.trade.trade = Some(trade);
            self.trade.unsaved = true;
        }
        if let Some(end) = measuring.task.end() {
            self.trade.measuring = None;
            if let Err(message) = end {
                self.notices.say(Level::Error, message);
            }
        }
    }

    /// Forgets the trade of the capture before and reads that of the one that is open now.
    pub(in crate::app) fn trade_of_capture(&mut self) {
        if let Some(measuring) = &self.trade.measuring {
            measuring.task.cancel();
        }
        self.trade.trade = None;
        self.trade.unsaved = false;
        if let Some(capture) = self.capture().cloned()
            && let Err(message) = self.trade.load(&capture.source.default_out(), &capture)
        {
            self.notices.say(Level::Warning, message);
        }
    }

    /// Writes the trade where it is found again when the capture is opened next.
    pub fn keep_trade(&mut self) {
        let Some((trade, capture)) = self.trade.trade.clone().zip(self.capture()) else {
            return;
        };
        let folder = capture.source.default_out();
        match trade.write(&folder) {
            Ok(()) => {
                self.trade.unsaved = false;
                let message = format!("trade written to {}", folder.display());
                self.notices.say(Level::Info, message);
            }
            Err(error) => self.notices.say(Level::Error, error.to_string()),
        }
    }
}
