//! The checked summary of what is open.

use crate::app::theme;
use crate::inverse::solver::Progress;
use crate::session::snapshot::OpenCapture;
use egui::{RichText, Ui};

/// Draws the pane.
pub fn pane(ui: &mut Ui, capture: &OpenCapture, progress: &Progress) {
    let tokens = theme::tokens(ui);
    ui.label(RichText::new(&capture.name).heading().color(tokens.strong));
    for line in &capture.summary {
        ui.label(line);
    }
    for warning in capture.warnings.iter().chain(&progress.warnings) {
        ui.colored_label(tokens.warning, warning);
    }
    if !progress.rejected.is_empty() {
        ui.add_space(theme::GAP);
        ui.strong("Samples dropped");
        for (cause, count) in &progress.rejected {
            ui.label(format!("{cause}: {count}"));
        }
    }
}
