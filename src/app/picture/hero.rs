//! The photograph as it was changed: other light, other materials, inserted objects. Alone, or beside another picture.

use crate::app::document::Document;
use crate::app::picture::canvas;
use crate::app::picture::quantity::Quantity;
use crate::app::picture::wipe::wipe;
use crate::app::theme;
use crate::app::view::{Parts, ViewState};
use egui::Ui;

/// What it can be wiped against.
const AGAINST: [Quantity; 3] = [Quantity::Photograph, Quantity::Naive, Quantity::Render];

pub fn pane(ui: &mut Ui, parts: &mut Parts<'_>) {
    let composite = Quantity::Composite;
    parts.view.needed.note(composite);
    theme::strip(ui, |ui| controls(ui, parts.document, parts.view));
    let rect = ui.available_rect_before_wrap();
    let view = &mut *parts.view;
    match view.compare.against.filter(|_| !view.look.photograph) {
        Some(left) => {
            view.needed.note(left);
            wipe(ui, parts, rect, [left, composite]);
        }
        None => canvas::pane(ui, parts, rect, composite),
    }
}

fn controls(ui: &mut Ui, document: &Document, view: &mut ViewState) {
    ui.horizontal_wrapped(|ui| {
        ui.label("Wipe against");
        let against = &mut view.compare.against;
        let nothing = ui.selectable_value(against, None, "nothing");
        nothing.on_hover_text("The photograph as you changed it, alone");
        for quantity in AGAINST {
            let name = quantity.name().to_lowercase();
            let choice = ui.selectable_value(against, Some(quantity), name);
            choice.on_hover_text(quantity.help());
        }
        let insertion = document.snapshot.insertion.as_ref();
        let insertion = insertion.filter(|insertion| insertion.frame == view.shown.frame);
        ui.weak(match insertion.and_then(|insertion| insertion.samples) {
            None => "as taken".to_owned(),
            Some(0) => "a first look".to_owned(),
            Some(samples) => format!("{samples} samples a pixel"),
        });
    });
}
