//! The sheet that writes photographs with objects in them and in changed light, and how far that is.

use crate::app::action::Action;
use crate::app::controls::named;
use crate::app::document::Document;
use crate::app::request::{Request, Requests};
use crate::app::shell::path::path_and_buttons;
use crate::app::shell::sheet::Wanted;
use crate::app::task::Task;
use crate::session::photographs::{WriteProgress, Written};
use egui::{Button, DragValue, ProgressBar, Role, Ui};
use std::path::PathBuf;

/// Photographs that are being written.
pub struct Batch {
    /// The folder that they are written into.
    pub folder: PathBuf,
    /// What it is at.
    pub doing: Option<WriteProgress>,
    /// How many photographs it is to write.
    pub wanted: usize,
    /// The work.
    pub task: Task<WriteProgress, Written>,
}

/// Draws the sheet; true when it is to close.
pub fn sheet(
    ui: &mut Ui,
    document: &Document,
    frame: usize,
    wanted: &mut Wanted,
    requests: &mut Requests,
) -> bool {
    ui.heading("Save photographs");
    let objects = document.insertions.visible().len();
    ui.label(match (objects, document.edits.is_empty()) {
        (0, true) => "Insert an object, or change a lamp or a material first.",
        (0, false) => "At full size, in the light as you changed it.",
        (_, true) => "At full size, with the inserted objects; naive composites and layers beside them.",
        (_, false) => {
            "At full size, in the light as you changed it and with the inserted objects; naive composites and \
             layers beside them."
        }
    });
    ui.horizontal(|ui| {
        let count = document.frames();
        ui.radio_value(&mut wanted.all, true, format!("All {count} photographs"));
        let shown = format!("Photograph {} alone, as {frame:03}", frame + 1);
        ui.radio_value(&mut wanted.all, false, shown);
    });
    ui.horizontal(|ui| {
        let help = "Paths a pixel: four times as many halve the noise";
        let label = ui.label("Samples a pixel").on_hover_text(help);
        let drag = DragValue::new(&mut wanted.samples).range(1..=4096);
        ui.add(drag).labelled_by(label.id).on_hover_text(help);
        ui.checkbox(&mut wanted.denoise, "Denoise")
            .on_hover_text("Smooths the noise of light that is added or changed, guided by surfaces; never the photograph itself");
    });
    let ready = requests.can(Action::SavePhotographs);
    let go = ("Write", ready);
    let (go, close) = path_and_buttons(ui, "Folder", &mut wanted.folder, go, requests);
    if go {
        requests.ask(Request::Photographs(wanted.clone()));
    }
    close
}

/// How far the photographs are, with a button that ends them; for the status bar.
pub fn progress(ui: &mut Ui, batch: &Batch, requests: &mut Requests) {
    let folder = format!("Writes into {}", batch.folder.display());
    ui.separator();
    // The button comes first, where it stays while the rest changes.
    let (action, cancel) = (Action::CancelPhotographs, Button::new("Cancel").small());
    named(
        requests.button(ui, action, cancel),
        Role::Button,
        action.text(),
    );
    if let Some(doing) = batch.doing {
        let bar = ProgressBar::new(doing.fraction).desired_width(90.0);
        ui.add(bar.desired_height(8.0)).on_hover_text(&folder);
        ui.label(format!("photograph {}", doing.frame + 1))
            .on_hover_text(folder);
    }
}
