//! The menu bar, made from the table of actions.

use crate::app::action::{Action, Menu};
use crate::app::layout::{self, Pane, Workspace};
use crate::app::state::App;
use egui::{Button, Ui};
use egui_tiles::Tree;

/// Draws the menu bar.
pub fn bar(ui: &mut Ui, app: &mut App, tree: &mut Tree<Pane>) {
    egui::MenuBar::new().ui(ui, |ui| {
        for menu in Menu::ALL {
            ui.menu_button(menu.title(), |ui| {
                ui.set_min_width(220.0);
                let ctx = ui.ctx().clone();
                for &action in Action::ALL.iter().filter(|a| a.menu() == menu) {
                    if item(ui, app, action) {
                        app.perform(action, &ctx);
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
            for (workspace, action) in [
                (Workspace::Inspect, Action::Inspect),
                (Workspace::Compose, Action::Compose),
            ] {
                let shown = app.preferences.workspace == workspace;
                let tab = ui.selectable_label(shown, action.text());
                if tab.on_hover_text(action.help()).clicked() {
                    app.perform(action, &ui.ctx().clone());
                }
            }
            ui.separator();
            if let Some(capture) = app.capture() {
                ui.weak(&capture.name);
            }
        });
    });
}

/// One item; true when it is chosen.
fn item(ui: &mut Ui, app: &App, action: Action) -> bool {
    let button = Button::new(action.text()).shortcut_text(action.keys(ui.ctx()));
    ui.add_enabled(app.can(action), button)
        .on_hover_text(action.help())
        .clicked()
}

/// A tick for each pane, to open and close it.
fn panes(ui: &mut Ui, tree: &mut Tree<Pane>) {
    for pane in Pane::all() {
        let mut open = layout::is_open(tree, pane);
        if ui.checkbox(&mut open, pane.title()).clicked() {
            if open {
                layout::show(tree, pane);
            } else {
                layout::close(tree, pane);
            }
        }
    }
}
