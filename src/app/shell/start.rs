//! The start page: the built-in room, a typed path, recent captures, and where to drop a folder.

use crate::app::action::Action;
use crate::app::controls::path_field;
use crate::app::request::{Request, Requests};
use crate::app::shell::{Shell, sessions};
use crate::app::theme;
use crate::app::view::Parts;
use crate::session::command::Source;
use egui::{Align, Button, Frame, Layout, RichText, Stroke, Ui, vec2};
use std::path::PathBuf;

/// Draws the page; `importing` says how far the import of a scan is.
pub fn page(ui: &mut Ui, parts: &mut Parts<'_>, importing: Option<String>, recent: &[PathBuf]) {
    let tokens = theme::tokens(ui);
    ui.painter().rect_filled(ui.max_rect(), 0.0, tokens.panel);
    ui.vertical_centered(|ui| {
        let (shell, requests) = (&mut parts.view.shell, &mut *parts.requests);
        ui.set_max_width(560.0);
        ui.add_space((ui.available_height() * 0.12).max(8.0));
        ui.label(RichText::new("relit").size(34.0).color(tokens.strong));
        ui.label("Recovers the lights and materials of a scanned room from photographs,\nand puts new objects into them.");
        ui.add_space(18.0);
        let room = Button::new(RichText::new("Open the built-in room").size(15.0))
            .min_size(vec2(260.0, 34.0))
            .fill(tokens.selection);
        requests.button(ui, Action::OpenRoom, room);
        ui.add_space(14.0);
        typed_path(ui, shell, requests);
        if let Some(doing) = importing {
            ui.horizontal(|ui| {
                ui.spinner();
                ui.label(format!("Importing the scan: {doing}"));
                if ui.button("Cancel import").clicked() {
                    requests.ask(Request::CancelImport);
                }
            });
        }
        if let Some(problem) = &shell.start.problem {
            ui.colored_label(tokens.error, problem);
        }
        ui.add_space(10.0);
        drop_area(ui);
        ui.add_space(10.0);
        if !recent.is_empty() {
            ui.weak("Recent captures");
        }
        for folder in recent {
            if ui.button(folder.display().to_string()).clicked() {
                requests.ask(Request::Open(Source::Folder(folder.clone())));
            }
        }
        let kept = &parts.document.snapshot.kept;
        if !kept.is_empty() {
            ui.add_space(10.0);
            ui.weak("Sessions");
            let newest = &kept[..kept.len().min(4)];
            sessions::list(ui, parts, newest);
        }
    });
}

fn typed_path(ui: &mut Ui, shell: &mut Shell, requests: &mut Requests) {
    let row = Layout::left_to_right(Align::Center);
    ui.allocate_ui_with_layout(vec2(540.0, 24.0), row, |ui| {
        let hint = "a folder with transforms.json, results or a scan";
        let typed = &mut shell.start.path;
        let (field, entered) = path_field(ui, "Capture folder", typed, hint, 300.0);
        // What is typed belongs here.
        if ui.memory(|memory| memory.focused().is_none()) && shell.palette.is_none() {
            field.request_focus();
        }
        let path = PathBuf::from(shell.start.path.trim());
        let is_typed = !path.as_os_str().is_empty();
        let open = ui.add_enabled(is_typed, Button::new("Open"));
        if is_typed && (entered || open.clicked()) {
            requests.ask(Request::OpenPath(path));
        }
        requests.button(ui, Action::OpenFolder, Button::new("Browse…"));
    });
}

fn drop_area(ui: &mut Ui) {
    let tokens = theme::tokens(ui);
    let hovering = ui.input(|input| !input.raw.hovered_files.is_empty());
    let color = match hovering {
        true => tokens.accent,
        false => tokens.outline,
    };
    Frame::NONE
        .stroke(Stroke::new(1.5, color))
        .fill(tokens.sunken)
        .corner_radius(6)
        .inner_margin(18)
        .show(ui, |ui| {
            ui.set_width(504.0);
            ui.vertical_centered(|ui| {
                ui.weak("Drop the folder of a capture, of results or of a scan here")
            });
        });
}
