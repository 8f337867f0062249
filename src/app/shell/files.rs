//! Draws the sheets: a typed path, a dialog where there is one.

use crate::app::controls::{go_or_cancel, point};
use crate::app::document::Document;
use crate::app::request::{Request, Requests};
use crate::app::shell::path::path_and_buttons;
use crate::app::shell::sheet::{FORMATS, Sheet, ending};
use crate::app::shell::{photographs, sessions};
use crate::app::view::ViewState;
use crate::session::command::{Command, ExportFormat, ExportRequest};
use egui::{DragValue, Id, Modal, Ui};
use glam::DVec3;
use std::path::PathBuf;

/// Draws the sheet while it is open.
pub fn show(
    ctx: &egui::Context,
    document: &Document,
    view: &mut ViewState,
    requests: &mut Requests,
) {
    let mut sheet = std::mem::take(&mut view.shell.sheet);
    if matches!(sheet, Sheet::Closed) {
        return;
    }
    let modal = Modal::new(Id::unique("sheet")).show(ctx, |ui| {
        ui.set_width(420.0);
        match &mut sheet {
            Sheet::Closed => true,
            Sheet::Sessions => sessions::sheet(ui, document, &mut view.shell.sessions, requests),
            Sheet::Save(folder) => save(ui, folder, requests),
            Sheet::Layers(file) => layers(ui, document, view, file, requests),
            Sheet::Export { file, format, at } => {
                export(ui, document, (file, format, at), requests)
            }
            Sheet::Length { found, metres } => length(ui, *found, metres, requests),
            Sheet::Photographs(wanted) => {
                photographs::sheet(ui, document, view.shown.frame, wanted, requests)
            }
        }
    });
    if !modal.inner && !modal.should_close() {
        view.shell.sheet = sheet;
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
fn layers(
    ui: &mut Ui,
    document: &Document,
    view: &mut ViewState,
    file: &mut String,
    requests: &mut Requests,
) -> bool {
    ui.heading("Save light layers");
    ui.label("One OpenEXR file with the light of each lamp, as the shown view has it so far.");
    view.needed.layers = true;
    let shown = view.shown.view(document);
    let layers = shown.and_then(|view| view.layers.as_ref());
    ui.weak(layers.map_or_else(
        || "Tracing the light of each lamp…".to_owned(),
        |layers| format!("{} samples a pixel so far", layers.samples),
    ));
    let ready = layers.is_some();
    let (go, close) = path_and_buttons(ui, "File", file, ("Save", ready), requests);
    if go {
        let file = PathBuf::from(file.trim());
        requests.ask(Request::Send(Command::SaveLayers(file)));
    }
    close
}

/// Draws the sheet for exporting; true when it is to close.
fn export(
    ui: &mut Ui,
    document: &Document,
    (file, chosen, at): (&mut String, &mut usize, &mut DVec3),
    requests: &mut Requests,
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
            let diameter = document.capture().map_or(1.0, |open| open.scene.diameter);
            point(ui, "Point", at, f64::from(diameter) * 1e-3);
        });
        format = ExportFormat::Probe { at: *at };
    }
    let (go, close) = path_and_buttons(ui, "File", file, ("Export", true), requests);
    if go {
        let path = PathBuf::from(file.trim());
        let request = ExportRequest { format, path };
        requests.ask(Request::Send(Command::Export(request)));
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
        let label = ui.label("Length");
        let drag = DragValue::new(metres).range(1e-6..=1e6);
        let drag = drag.speed(found * 1e-3).max_decimals(4).suffix(" m");
        ui.add(drag).labelled_by(label.id);
    });
    let (clicked, cancel) = go_or_cancel(ui, "Set", *metres > 0.0);
    if clicked {
        requests.ask(Request::Length(found, *metres));
    }
    clicked || cancel
}
