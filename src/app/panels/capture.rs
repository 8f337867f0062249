//! The checked summary of what is open.

use crate::app::state::App;
use crate::app::theme;
use egui::{RichText, ScrollArea, Ui};

/// Draws the pane.
pub fn pane(ui: &mut Ui, app: &mut App) {
    let tokens = theme::tokens(ui);
    let Some(capture) = app.capture() else {
        ui.weak(app.nothing_open());
        return;
    };
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        ui.label(RichText::new(&capture.name).heading().color(tokens.strong));
        for line in &capture.summary {
            ui.label(line);
        }
        let warnings = capture
            .warnings
            .iter()
            .chain(&app.snapshot.progress.warnings);
        for warning in warnings {
            ui.colored_label(tokens.warning, warning);
        }
        let rejected = &app.snapshot.progress.rejected;
        if !rejected.is_empty() {
            ui.add_space(theme::GAP);
            ui.strong("Samples dropped");
            for (cause, count) in rejected {
                ui.label(format!("{cause}: {count}"));
            }
        }
    });
}
