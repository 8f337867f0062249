//! The ladder of models: what was tried, what it cost, and why it was kept or not.

use crate::app::picture::inspect::number;
use crate::app::state::App;
use crate::app::theme;
use egui::{Label, ScrollArea, Ui};

/// Draws the pane.
pub fn pane(ui: &mut Ui, app: &mut App) {
    let tokens = theme::tokens(ui);
    let progress = &app.snapshot.progress;
    if progress.stages.is_empty() {
        ui.weak("No stage has ended yet");
        return;
    }
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        for stage in &progress.stages {
            ui.horizontal(|ui| {
                if stage.kept {
                    ui.colored_label(tokens.good, "kept");
                } else {
                    ui.colored_label(tokens.weak, "dropped");
                }
                ui.strong(&stage.name);
                ui.weak(format!(
                    "{:.1} s, {} iterations",
                    stage.seconds, stage.iterations
                ));
            });
            ui.add(Label::new(&stage.why).wrap());
            let loss = |name: &str, loss: Option<f64>| {
                loss.map(|loss| format!("{name} {}", number(loss as f32)))
            };
            let losses: Vec<String> = [
                loss("loss", stage.train_loss),
                loss("held out", stage.held_out_loss),
            ]
            .into_iter()
            .flatten()
            .collect();
            if !losses.is_empty() {
                ui.weak(losses.join(", "));
            }
            ui.separator();
        }
    });
}
