//! What is said of the capture and of its solve.

use crate::app::number::number;
use crate::app::shell::notices::{Notices, level_color};
use crate::app::theme;
use crate::inverse::solver::Progress;
use crate::session::snapshot::OpenCapture;
use egui::{Label, RichText, ScrollArea, Ui};

pub fn capture(ui: &mut Ui, capture: &OpenCapture, progress: &Progress) {
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

/// Draws the stages: what was tried, what it cost, and why it was kept or dropped.
pub fn stages(ui: &mut Ui, progress: &Progress) {
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

/// Draws everything that happened, the newest at the end.
pub fn log(ui: &mut Ui, notices: &Notices) {
    if notices.log.is_empty() {
        ui.weak("No messages yet");
        return;
    }
    ScrollArea::vertical()
        .auto_shrink(false)
        .stick_to_bottom(true)
        .show(ui, |ui| {
            for event in &notices.log {
                ui.horizontal_top(|ui| {
                    let color = level_color(ui, event.level);
                    ui.colored_label(color, format!("{:?}", event.level));
                    ui.add(Label::new(&event.message).wrap());
                });
            }
        });
}
