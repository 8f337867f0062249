//! The window of keys and mouse.

use crate::app::action::{Action, Menu};
use egui::{Grid, ScrollArea, Window};

/// What the mouse does: where and how, and what.
const MOUSE: &str = "\
Picture: wheel | Zoom to the pointer, in all pictures at once
Picture: drag | Pan
Picture: click | Select the object, or place the chosen one
Picture: double click | Fit
Inserted object: drag its foot | Move it over surfaces; with Shift up and down, with Ctrl on its level
Inserted object: drag the ring beside it | Turn
Inserted object: drag the square above it | Scale
With Blender's keys: G, R, S | Move, rotate, scale; X, Y, Z hold an axis, Esc takes it back
3D view: drag | Orbit
3D view: right drag, middle drag, Shift + drag | Pan
3D view: wheel | Zoom to the pointer
3D view: W A S D, Q E | Fly; with Shift faster
3D view: click | Select, place, or look through a camera
3D view: double click | Turn about this depth
Tab: drag | Move a pane";

pub fn show(ctx: &egui::Context, open: &mut bool) {
    Window::new("Keys and mouse")
        .open(open)
        .collapsible(false)
        .resizable(false)
        .anchor(egui::Align2::CENTER_CENTER, [0.0, 0.0])
        .show(ctx, |ui| {
            ScrollArea::vertical()
                .max_height(560.0)
                .min_scrolled_height(560.0)
                .show(ui, |ui| {
                    let grid = |name| Grid::new(name).num_columns(2).striped(true);
                    for menu in Menu::ALL {
                        ui.strong(menu.name());
                        grid(menu.name()).show(ui, |ui| {
                            let actions = Action::ALL.iter().filter(|a| a.menu() == menu);
                            for action in actions.filter(|a| a.shortcut().is_some()) {
                                ui.monospace(action.keys(ctx));
                                ui.label(action.text()).on_hover_text(action.help());
                                ui.end_row();
                            }
                        });
                        ui.add_space(6.0);
                    }
                    ui.strong("Mouse");
                    grid("mouse").show(ui, |ui| {
                        let lines = MOUSE.lines();
                        for (how, what) in lines.filter_map(|line| line.split_once(" | ")) {
                            ui.label(how);
                            ui.label(what);
                            ui.end_row();
                        }
                    });
                });
        });
}
