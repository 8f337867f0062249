//! The checked summary of what is open.

use crate::app::document::Document;
use crate::app::theme;
use egui::{RichText, ScrollArea, Ui};

/// Draws the pane.
pub fn pane(ui: &mut Ui, document: &Document) {
    let tokens = theme::tokens(ui);
    let Some(capture) = document.capture() else {
        ui.weak(document.nothing_open());
        return;
    };
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        ui.label(RichText::new(&capture.name).heading().color(tokens.strong));
        for line in &capture.summary {
            ui.label(line);
        }
        let progress = &document.snapshot.progress;
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
    });
}
