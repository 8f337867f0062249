//! The sheet that writes photographs with objects in them and in changed light, and how far that is.

use crate::app::action::Action;
use crate::app::shell::dialogs::Ask;
use crate::app::shell::files::{buttons, file_name, path_field};
use crate::app::state::App;
use egui::{Button, DragValue, ProgressBar, Ui};
use std::path::PathBuf;

/// What is asked for.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// The folder as typed.
    pub folder: String,
    /// All photographs rather than the shown one.
    pub all: bool,
    /// Samples a pixel.
    pub samples: u32,
    /// Whether noise is smoothed.
    pub denoise: bool,
}

impl Wanted {
    /// All photographs of a capture, into a folder beside its results.
    pub fn new(name: &str) -> Self {
        Self {
            folder: format!("relit-out/{}-photographs", file_name(name)),
            all: true,
            samples: 64,
            denoise: true,
        }
    }
}

/// Draws the sheet; true when it is to close.
pub fn sheet(ui: &mut Ui, app: &mut App, wanted: &mut Wanted) -> bool {
    ui.heading("Save photographs");
    let objects = app.insertions.visible().len();
    let edits = app.edits.clone();
    ui.label(match (objects, edits.is_empty()) {
        (0, true) => "Insert an object, or change a lamp or a material first.",
        (0, false) => "At full size, in the light as you changed it.",
        (_, true) => "At full size, with the inserted objects; naive composites and layers beside them.",
        (_, false) => {
            "At full size, in the light as you changed it and with the inserted objects; naive composites and \
             layers beside them."
        }
    });
    ui.horizontal(|ui| {
        let count = app.frames();
        ui.radio_value(&mut wanted.all, true, format!("All {count} photographs"));
        let shown = format!("Photograph {} alone, as {:03}", app.frame + 1, app.frame);
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
    let entered = path_field(ui, app, "Folder", &mut wanted.folder, Ask::SaveFolder);
    let nothing = objects == 0 && edits.is_empty();
    let ready = app.can_write_photographs() && !nothing && !wanted.folder.trim().is_empty();
    let (clicked, cancel) = buttons(ui, "Write", ready);
    let go = (clicked || entered) && ready;
    if go {
        let folder = PathBuf::from(wanted.folder.trim());
        let frame = (!wanted.all).then_some(app.frame);
        app.write_photographs(
            &ui.ctx().clone(),
            folder,
            frame,
            &edits,
            (wanted.samples, wanted.denoise),
        );
    }
    go || cancel
}

/// How far the photographs are, with a button that ends them; for the status bar.
pub fn progress(ui: &mut Ui, app: &mut App) {
    let Some(batch) = &app.batch else {
        return;
    };
    let folder = format!("Writes into {}", batch.folder().display());
    ui.separator();
    // The button comes first, where it stays while the rest changes.
    let doing = batch.doing();
    let cancel = ui.add(Button::new("Cancel").small());
    cancel.widget_info(|| {
        let text = Action::CancelPhotographs.text();
        egui::WidgetInfo::labeled(egui::Role::Button, true, text)
    });
    if cancel
        .on_hover_text(Action::CancelPhotographs.help())
        .clicked()
    {
        app.perform(Action::CancelPhotographs, &ui.ctx().clone());
    }
    if let Some(doing) = doing {
        let bar = ProgressBar::new(doing.fraction)
            .desired_width(90.0)
            .desired_height(8.0);
        ui.add(bar).on_hover_text(&folder);
        ui.label(format!("photograph {}", doing.frame + 1))
            .on_hover_text(folder);
    }
}
