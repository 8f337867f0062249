//! The photograph as it was changed: other light, other materials, inserted objects. Alone, or beside another picture.

use crate::app::picture::canvas;
use crate::app::picture::compare;
use crate::app::picture::quantity::Quantity;
use crate::app::state::App;
use crate::app::theme;
use egui::Ui;

/// What it can be wiped against.
const AGAINST: [Quantity; 3] = [Quantity::Photograph, Quantity::Naive, Quantity::Render];

/// Draws the pane.
pub fn pane(ui: &mut Ui, app: &mut App) {
    app.need(Quantity::Composite);
    theme::strip(ui).show(ui, |ui| {
        ui.set_min_width(ui.available_width());
        controls(ui, app);
    });
    let rect = ui.available_rect_before_wrap();
    match app.against.filter(|_| !app.look.photograph) {
        Some(left) => {
            app.need(left);
            compare::wipe(ui, app, rect, left, Quantity::Composite);
        }
        None => {
            let mut ui = ui.new_child(egui::UiBuilder::new().max_rect(rect));
            canvas::pane(&mut ui, app, Quantity::Composite);
        }
    }
}

fn controls(ui: &mut Ui, app: &mut App) {
    ui.horizontal_wrapped(|ui| {
        ui.label("Wipe against");
        let nothing = ui.selectable_value(&mut app.against, None, "nothing");
        nothing.on_hover_text("The photograph as you changed it, alone");
        for quantity in AGAINST {
            let name = quantity.name().to_lowercase();
            let choice = ui.selectable_value(&mut app.against, Some(quantity), name);
            choice.on_hover_text(quantity.help());
        }
        let shown = app.snapshot.insertion.as_ref();
        let samples = shown
            .filter(|i| i.frame == app.frame)
            .and_then(|i| i.samples);
        ui.weak(samples.map_or_else(
            || "as taken".to_owned(),
            |samples| match samples {
                0 => "a first look".to_owned(),
                samples => format!("{samples} samples a pixel"),
            },
        ));
    });
}
