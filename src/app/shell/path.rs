//! The path of a sheet, typed or chosen in a dialog, and the sheet's buttons.

use crate::app::controls::{go_or_cancel, path_field};
use crate::app::request::{Request, Requests};
use crate::app::shell::dialogs::Ask;
use egui::Ui;

/// Draws the path of a sheet and its buttons: whether to go on with what is typed, and whether to close.
pub fn path_and_buttons(
    ui: &mut Ui,
    label: &str,
    path: &mut String,
    (go, ready): (&str, bool),
    requests: &mut Requests,
) -> (bool, bool) {
    let ask = match label {
        "Folder" => Ask::SaveFolder,
        _ => Ask::ExportFile,
    };
    let entered = ui.horizontal(|ui| {
        let (field, entered) = path_field(ui, label, path, "", 270.0);
        // Takes the keys at once.
        if ui.memory(|memory| memory.focused().is_none()) {
            field.request_focus();
        }
        if ui.button("Browse…").clicked() {
            requests.ask(Request::Browse(ask));
        }
        entered
    });
    let ready = ready && !path.trim().is_empty();
    let (clicked, cancel) = go_or_cancel(ui, go, ready);
    let go = (clicked || entered.inner) && ready;
    (go, go || cancel)
}
