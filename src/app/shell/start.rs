//! The start page: the built-in room, a typed path, recent captures, and where to drop a folder.

use crate::app::action::Action;
use crate::app::shell::sessions;
use crate::app::state::App;
use crate::app::theme;
use crate::session::command::Source;
use egui::{Align, Button, Frame, Layout, RichText, Stroke, TextEdit, Ui, vec2};

/// Draws the page.
pub fn page(ui: &mut Ui, app: &mut App) {
    let tokens = theme::tokens(ui);
    ui.painter().rect_filled(ui.max_rect(), 0.0, tokens.panel);
    ui.vertical_centered(|ui| {
        ui.set_max_width(560.0);
        ui.add_space((ui.available_height() * 0.12).max(8.0));
        ui.label(RichText::new("relit").size(34.0).color(tokens.strong));
        ui.label("Recovers the lights and materials of a scanned room from photographs,\nand puts new objects into them.");
        ui.add_space(18.0);
        let room = Button::new(RichText::new("Open the built-in room").size(15.0))
            .min_size(vec2(260.0, 34.0))
            .fill(tokens.selection);
        if ui.add(room).on_hover_text(Action::OpenRoom.help()).clicked() {
            app.open(Source::BuiltInRoom);
        }
        ui.add_space(14.0);
        typed_path(ui, app);
        trouble(ui, app);
        ui.add_space(10.0);
        drop_area(ui);
        ui.add_space(10.0);
        recent(ui, app);
        if !app.snapshot.kept.is_empty() {
            ui.add_space(10.0);
            ui.weak("Sessions");
            sessions::list(ui, app, 4);
        }
    });
}

fn typed_path(ui: &mut Ui, app: &mut App) {
    ui.allocate_ui_with_layout(
        vec2(540.0, 24.0),
        Layout::left_to_right(Align::Center),
        |ui| {
            let label = ui.label("Capture folder");
            let field = TextEdit::singleline(&mut app.path)
                .hint_text("a folder with transforms.json, results or a scan")
                .desired_width(300.0);
            let response = ui.add(field).labelled_by(label.id);
            // What is typed belongs here.
            if ui.memory(|memory| memory.focused().is_none()) && app.palette.is_none() {
                response.request_focus();
            }
            let entered =
                response.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
            let open = ui.add_enabled(!app.path.trim().is_empty(), Button::new("Open"));
            if entered || open.clicked() {
                app.open_typed(&ui.ctx().clone());
            }
            if ui
                .button("Browse…")
                .on_hover_text(Action::OpenFolder.help())
                .clicked()
            {
                app.perform(Action::OpenFolder, &ui.ctx().clone());
            }
        },
    );
}

/// Why nothing was opened, or how far an import is.
fn trouble(ui: &mut Ui, app: &mut App) {
    if let Some(importing) = &app.importing {
        let doing = importing.doing();
        let mut cancel = false;
        ui.horizontal(|ui| {
            ui.spinner();
            ui.label(format!("Importing the scan: {doing}"));
            cancel = ui.button("Cancel import").clicked();
        });
        if cancel {
            app.cancel_import();
        }
    }
    if let Some(trouble) = &app.trouble {
        ui.colored_label(theme::tokens(ui).error, trouble);
    }
}

fn drop_area(ui: &mut Ui) {
    let tokens = theme::tokens(ui);
    let hovering = ui.input(|input| !input.raw.hovered_files.is_empty());
    let color = if hovering {
        tokens.accent
    } else {
        tokens.outline
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

fn recent(ui: &mut Ui, app: &mut App) {
    if app.preferences.recent.is_empty() {
        return;
    }
    ui.weak("Recent captures");
    let mut chosen = None;
    for folder in &app.preferences.recent {
        if ui.button(folder.display().to_string()).clicked() {
            chosen = Some(folder.clone());
        }
    }
    if let Some(folder) = chosen {
        app.open(Source::Folder(folder));
    }
}
