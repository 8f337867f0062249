//! Draws the sheets: a typed path, a dialog where there is one.

use crate::app::controls::{go_or_cancel, labelled, point};
use crate::app::request::{Request, Requests};
use crate::app::shell::path::path_and_buttons;
use crate::app::shell::sheet::{FORMATS, Sheet, ending};
use crate::app::shell::{photographs, sessions};
use crate::app::view::Parts;
use crate::session::command::{Command, ExportFormat, ExportRequest};
use egui::{DragValue, Id, Modal, Ui};
use glam::DVec3;
use std::path::PathBuf;

/// Draws the sheet while it is open.
pub fn show(ctx: &egui::Context, parts: &mut Parts<'_>) {
    let mut sheet = std::mem::take(&mut parts.view.shell.sheet);
    if matches!(sheet, Sheet::Closed) {
        return;
    }
    let modal = Modal::new(Id::unique("sheet")).show(ctx, |ui| {
        ui.set_width(420.0);
        let (document, requests) = (parts.document, &mut *parts.requests);
        let view = &mut *parts.view;
        match &mut sheet {
            Sheet::Closed => true,
            Sheet::Sessions => sessions::sheet(ui, document, &mut view.shell.sessions, requests),
            Sheet::Save(folder) => save(ui, folder, requests),
            Sheet::Layers(file) => layers(ui, parts, file),
            Sheet::Export { file, format, at } => export(ui, parts, (file, format, at)),
            Sheet::Length { found, metres } => length(ui, *found, metres, requests),
            Sheet::Photographs(wanted) => {
                photographs::sheet(ui, document, view.shown.frame, wanted, requests)
            }
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
    let (go, close) = path_and_buttons(ui, "Folder", folder, ("Save", true), requests);
    if go {
        let folder = PathBuf::from(folder.trim());
        requests.ask(Request::Send(Command::Save(folder)));
    }
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
    let (go, close) = path_and_buttons(ui, "File", file, ("Save", ready), parts.requests);
    if go {
        let file = PathBuf::from(file.trim());
        parts.requests.ask(Request::Send(Command::SaveLayers(file)));
    }
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
    let (go, close) = path_and_buttons(ui, "File", file, ("Export", true), parts.requests);
    if go {
        let path = PathBuf::from(file.trim());
        let request = ExportRequest { format, path };
        let export = Request::Send(Command::Export(request));
        parts.requests.ask(export);
    }
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
