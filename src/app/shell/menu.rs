//! The menu bar, made from the table of actions.

use crate::app::action::{Action, Menu};
use crate::app::layout::{self, Pane, Workspace};
use crate::app::view::Parts;
use egui::{Button, Ui};
use egui_tiles::Tree;

/// Draws the menu bar, with the name of the capture and the workspaces at its end.
pub fn bar(ui: &mut Ui, parts: &mut Parts<'_>, workspace: Workspace, tree: &mut Tree<Pane>) {
    let requests = &mut *parts.requests;
    egui::MenuBar::new().ui(ui, |ui| {
        for menu in Menu::ALL {
            ui.menu_button(menu.name(), |ui| {
                ui.set_min_width(220.0);
                for &action in Action::ALL.iter().filter(|a| a.menu() == menu) {
                    let button = Button::new(action.text()).shortcut_text(action.keys(ui.ctx()));
                    if requests.button(ui, action, button).clicked() {
                        ui.close();
                    }
                }
                if menu == Menu::Window {
                    ui.separator();
                    panes(ui, tree);
                }
            });
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            for (shown, action) in [
                (Workspace::Inspect, Action::Inspect),
                (Workspace::Compose, Action::Compose),
            ] {
                let tab = ui.selectable_label(workspace == shown, action.text());
                if tab.on_hover_text(action.help()).clicked() {
                    requests.ask(action);
                }
            }
            ui.separator();
            if let Some(capture) = parts.document.capture() {
                ui.weak(&capture.name);
            }
        });
    });
}

/// A tick for each pane, to open and close it.
fn panes(ui: &mut Ui, tree: &mut Tree<Pane>) {
    for pane in Pane::all() {
        let mut open = layout::is_open(tree, pane);
        if ui.checkbox(&mut open, pane.title()).clicked() {
            match open {
                true => layout::show(tree, pane),
                false => layout::close(tree, pane),
            }
        }
    }
}
