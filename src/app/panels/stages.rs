//! The stages of the solve: what was tried, what it cost, and why it was kept or dropped.

use crate::app::number::number;
use crate::app::theme;
use crate::inverse::solver::Progress;
use egui::{Label, Ui};

/// Draws the pane.
pub fn pane(ui: &mut Ui, progress: &Progress) {
    let tokens = theme::tokens(ui);
    if progress.stages.is_empty() {
        ui.weak("No stage has ended yet");
        return;
    }
    for stage in &progress.stages {
        ui.horizontal(|ui| {
            match stage.kept {
                true => ui.colored_label(tokens.good, "kept"),
                false => ui.colored_label(tokens.weak, "dropped"),
            };
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
        let train = loss("loss", stage.train_loss);
        let losses: Vec<String> = (train.into_iter())
            .chain(loss("held out", stage.held_out_loss))
            .collect();
        if !losses.is_empty() {
            ui.weak(losses.join(", "));
        }
        ui.separator();
    }
}
