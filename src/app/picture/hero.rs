//! The photograph as it was changed: other light, other materials, inserted objects. Alone, or beside another picture.

use crate::app::document::Document;
use crate::app::picture::canvas;
use crate::app::picture::quantity::Quantity;
use crate::app::picture::wipe::wipe;
use crate::app::request::Requests;
use crate::app::theme;
use crate::app::view::ViewState;
use egui::{Ui, UiBuilder};

/// What it can be wiped against.
const AGAINST: [Quantity; 3] = [Quantity::Photograph, Quantity::Naive, Quantity::Render];

/// Draws the pane.
pub fn pane(ui: &mut Ui, document: &Document, view: &mut ViewState, requests: &mut Requests) {
    view.needed.note(Quantity::Composite);
    theme::strip(ui, |ui| controls(ui, document, view));
    let rect = ui.available_rect_before_wrap();
    let composite = Quantity::Composite;
    match view.compare.against.filter(|_| !view.look.photograph) {
        Some(left) => {
            view.needed.note(left);
            wipe(ui, document, view, requests, rect, left, composite);
        }
        None => {
            let mut ui = ui.new_child(UiBuilder::new().max_rect(rect));
            canvas::pane(&mut ui, document, view, requests, composite);
        }
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
