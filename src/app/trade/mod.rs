//! The trade of speed for exactness of the open capture, read from its results or measured here.

pub mod choice;

use crate::app::task::Task;
use crate::session::snapshot::OpenCapture;
use crate::study::trade::Trade;
use egui::Pos2;
use std::path::Path;
use std::sync::Arc;

/// What is plotted over seconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Vertical {
    /// The relative error that estimates claim of themselves; the paper's descent claims none.
    Claimed,
    /// The error as it was measured.
    Measured,
}

/// How the pane is shown.
#[derive(Debug)]
pub struct TradeView {
    /// What is plotted over seconds.
    pub vertical: Vertical,
    /// Seconds that a measurement may take.
    pub limit: f64,
    /// Where the points were drawn last: place on the screen, curve and point.
    pub places: Vec<(Pos2, usize, usize)>,
}

/// A measurement, which shows all curves so far.
pub type Measuring = Task<Arc<Trade>, ()>;

/// The trade of the open capture, as far as it is measured.
#[derive(Default)]
pub struct Measured {
    /// The curves of the open capture, as far as they are known.
    pub trade: Option<Arc<Trade>>,
    /// Whether the curves were measured here and are in no file yet.
    pub unsaved: bool,
    /// What is being measured, and the measurement under way.
    pub measuring: Option<(Arc<OpenCapture>, Measuring)>,
}

impl Default for TradeView {
    fn default() -> Self {
        Self {
            vertical: Vertical::Claimed,
            limit: 120.0,
            places: Vec::new(),
        }
    }
}

impl Measured {
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
        self.measuring.as_ref().map(|(_, task)| task.doing())
    }
}
