//! A button that shows a linear colour and opens a picker for it.

use crate::app::controls::named;
use egui::{Role, Ui};
use glam::Vec3;

/// Draws a button with a linear colour in [0, 1], which opens the picker; true when it was changed.
pub fn color_button(ui: &mut Ui, name: &str, help: &str, color: &mut Vec3) -> bool {
    let mut rgb = color.clamp(Vec3::ZERO, Vec3::ONE).to_array();
    let response = ui.color_edit_button_rgb(&mut rgb).on_hover_text(help);
    // The picker rounds; only what a hand changed is taken over.
    let changed = named(response, Role::ColorWell, name).changed();
    if changed {
        *color = Vec3::from_array(rgb).clamp(Vec3::ZERO, Vec3::ONE);
    }
    changed
}
