//! Draws the sheets: a typed path, a dialog where there is one.

use crate::app::action::Action;
use crate::app::controls::{go_or_cancel, labelled, path_field, point};
use crate::app::request::{Request, Requests};
use crate::app::shell::dialogs::Ask;
use crate::app::shell::sessions;
use crate::app::shell::sheet::{FORMATS, Sheet, Wanted, ending};
use crate::app::view::Parts;
use crate::session::command::{Command, ExportFormat, ExportRequest};
use egui::{DragValue, Id, Modal, Ui};
use glam::DVec3;
use std::path::PathBuf;

pub fn show(ctx: &egui::Context, parts: &mut Parts<'_>) {
    let mut sheet = std::mem::take(&mut parts.view.shell.sheet);
    if matches!(sheet, Sheet::Closed) {
        return;
    }
    let modal = Modal::new(Id::unique("sheet")).show(ctx, |ui| {
        ui.set_width(420.0);
        match &mut sheet {
            Sheet::Closed => true,
            Sheet::Sessions => sessions::sheet(ui, parts),
            Sheet::Save(folder) => save(ui, folder, parts.requests),
            Sheet::Layers(file) => layers(ui, parts, file),
            Sheet::Export { file, format, at } => export(ui, parts, (file, format, at)),
            Sheet::Length { found, metres } => length(ui, *found, metres, parts.requests),
            Sheet::Photographs(wanted) => photographs(ui, parts, wanted),
        }
    });
    if !modal.inner && !modal.should_close() {
        parts.view.shell.sheet = sheet;
    }
}

/// Draws the sheet for saving; true when it is to close.
fn save(ui: &mut Ui, folder: &mut String, requests: &mut Requests) -> bool {
    ui.heading("Save results");
    ui.label("Estimate, report, loss, scene and pictures, as `relit solve` writes them.");
    let (path, close) = path_and_buttons(ui, "Folder", folder, ("Save", true), requests);
    requests.ask_all(path.map(|folder| Request::Send(Command::Save(folder))));
    close
}

/// Draws the sheet for layers of light; true when it is to close.
fn layers(ui: &mut Ui, parts: &mut Parts<'_>, file: &mut String) -> bool {
    ui.heading("Save light layers");
    ui.label("One OpenEXR file with the light of each lamp, as the shown view has it so far.");
    parts.view.needed.layers = true;
    let shown = parts.view.shown.view(parts.document);
    let layers = shown.and_then(|view| view.layers.as_ref());
    ui.weak(layers.map_or_else(
        || "Tracing the light of each lamp…".to_owned(),
        |layers| format!("{} samples a pixel so far", layers.samples),
    ));
    let ready = layers.is_some();
    let (path, close) = path_and_buttons(ui, "File", file, ("Save", ready), parts.requests);
    let save = path.map(|file| Request::Send(Command::SaveLayers(file)));
    parts.requests.ask_all(save);
    close
}

/// Draws the sheet for exporting; true when it is to close.
fn export(
    ui: &mut Ui,
    parts: &mut Parts<'_>,
    (file, chosen, at): (&mut String, &mut usize, &mut DVec3),
) -> bool {
    ui.heading("Export");
    ui.horizontal_wrapped(|ui| {
        for (index, (name, help, _)) in FORMATS.iter().enumerate() {
            let label = ui.selectable_label(*chosen == index, *name);
            if label.on_hover_text(*help).clicked() {
                *chosen = index;
                let path = PathBuf::from(&*file).with_extension(ending(index));
                *file = path.to_string_lossy().into_owned();
            }
        }
    });
    let (_, help, mut format) = FORMATS[*chosen];
    ui.weak(help);
    if matches!(format, ExportFormat::Probe { .. }) {
        ui.horizontal(|ui| {
            ui.label("Point").on_hover_text(
                "In the capture's coordinates; File > Light probe by click takes it from a view",
            );
            let capture = parts.document.capture();
            let diameter = capture.map_or(1.0, |open| open.scene.diameter);
            point(ui, "Point", at, f64::from(diameter) * 1e-3);
        });
        format = ExportFormat::Probe { at: *at };
    }
    let (path, close) = path_and_buttons(ui, "File", file, ("Export", true), parts.requests);
    let request = path.map(|path| ExportRequest { format, path });
    let export = request.map(|request| Request::Send(Command::Export(request)));
    parts.requests.ask_all(export);
    close
}

/// Draws the sheet for a length; true when it is to close.
fn length(ui: &mut Ui, found: f64, metres: &mut f64, requests: &mut Requests) -> bool {
    ui.heading("Set the scale");
    ui.label(format!(
        "The clicked length is {found:.3} now. Inserted objects keep their own size in metres."
    ));
    ui.horizontal(|ui| {
        let drag = DragValue::new(metres).range(1e-6..=1e6);
        let drag = drag.speed(found * 1e-3).max_decimals(4).suffix(" m");
        labelled(ui, "Length", drag);
    });
    let (clicked, cancel) = go_or_cancel(ui, "Set", *metres > 0.0);
    if clicked {
        requests.ask(Request::Length(found, *metres));
    }
    clicked || cancel
}

/// Draws the sheet that writes photographs with objects in them and in changed light; true when it is to close.
fn photographs(ui: &mut Ui, parts: &mut Parts<'_>, wanted: &mut Wanted) -> bool {
    let (document, requests) = (parts.document, &mut *parts.requests);
    let frame = parts.view.shown.frame;
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
    let go = ("Write", requests.can(Action::SavePhotographs));
    let (path, close) = path_and_buttons(ui, "Folder", &mut wanted.folder, go, requests);
    requests.ask_all(path.map(|_| Request::Photographs(wanted.clone())));
    close
}

/// Draws the path of a sheet and its buttons: what is typed, if that is to be gone on with, and whether to close.
fn path_and_buttons(
    ui: &mut Ui,
    label: &str,
    path: &mut String,
    (go, ready): (&str, bool),
    requests: &mut Requests,
) -> (Option<PathBuf>, bool) {
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
    (go.then(|| path.trim().into()), go || cancel)
}
