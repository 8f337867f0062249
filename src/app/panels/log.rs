//! Everything that happened, the newest at the end.

use crate::app::shell::notices::{Notices, level_color};
use egui::{Label, ScrollArea, Ui};

/// Draws the pane.
pub fn pane(ui: &mut Ui, notices: &Notices) {
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
