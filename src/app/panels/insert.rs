//! Putting objects into the photographs: adding, placing, moving, turning, scaling, and the two results.

use crate::app::action::Action;
use crate::app::shell::dialogs::Ask;
use crate::app::state::App;
use crate::app::theme;
use egui::{Button, Checkbox, DragValue, Grid, ScrollArea, TextEdit, Ui};
use glam::DVec3;
use std::path::PathBuf;

/// Draws the pane.
pub fn pane(ui: &mut Ui, app: &mut App) {
    let Some(capture) = app.capture().cloned() else {
        ui.weak(app.nothing_open());
        return;
    };
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        add(ui, app);
        if let Some(trouble) = &app.insertions.trouble {
            ui.colored_label(theme::tokens(ui).error, trouble);
        }
        if app.insertions.objects.is_empty() {
            ui.add_space(theme::GAP);
            ui.weak("OBJ and GLB files can also be dropped on the window. Then click where the object should stand.");
            return;
        }
        ui.separator();
        list(ui, app);
        ui.separator();
        actions(ui, app);
        edit(ui, app, f64::from(capture.scene.diameter));
        size(ui, app);
        ui.separator();
        results(ui, app);
    });
}

fn add(ui: &mut Ui, app: &mut App) {
    ui.horizontal(|ui| {
        let label = ui.label("Object file");
        let width = (ui.available_width() - 136.0).max(60.0);
        let field = TextEdit::singleline(&mut app.insertions.path)
            .hint_text("chair.glb")
            .desired_width(width);
        let response = ui.add(field).labelled_by(label.id);
        if std::mem::take(&mut app.insertions.typing) {
            response.request_focus();
        }
        let entered =
            response.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
        let add = ui
            .button("Add")
            .on_hover_text("Adds the object whose path is typed");
        if (entered || add.clicked()) && !app.insertions.path.trim().is_empty() {
            let path = PathBuf::from(app.insertions.path.trim());
            app.insert(path);
        }
        if ui
            .button("Browse…")
            .on_hover_text("Chooses an object with a file dialog")
            .clicked()
        {
            app.ask(Ask::Object, &ui.ctx().clone());
        }
    });
}

/// All inserted objects.
fn list(ui: &mut Ui, app: &mut App) {
    for index in 0..app.insertions.objects.len() {
        ui.horizontal(|ui| {
            let object = &mut app.insertions.objects[index];
            let name = object.name();
            let mut visible = !object.placement.hidden;
            let shown = ui
                .add(Checkbox::without_text(&mut visible))
                .on_hover_text("Shows or hides the object");
            shown.widget_info(|| {
                egui::WidgetInfo::selected(
                    egui::Role::CheckBox,
                    true,
                    visible,
                    format!("Show {name} {}", index + 1),
                )
            });
            object.placement.hidden = !visible;
            let chosen = app.insertions.chosen == Some(index);
            let text = format!("{}  {name}", index + 1);
            if ui.selectable_label(chosen, text).clicked() {
                app.insertions.chosen = Some(index);
            }
            let object = &app.insertions.objects[index];
            if object.placement.at.is_none() {
                ui.weak("as modelled");
            }
        });
    }
}

/// Buttons for the chosen object.
fn actions(ui: &mut Ui, app: &mut App) {
    let ctx = ui.ctx().clone();
    ui.horizontal_wrapped(|ui| {
        let placing = app.insertions.placing;
        let text = if placing {
            "Click in a view…"
        } else {
            "Place by click"
        };
        let place = ui
            .add(Button::new(text).selected(placing))
            .on_hover_text(Action::Place.help());
        if place.clicked() {
            app.perform(Action::Place, &ctx);
        }
        for (action, text) in [
            (Action::Duplicate, "Duplicate"),
            (Action::Delete, "Delete"),
            (Action::Undo, "Undo"),
            (Action::Redo, "Redo"),
        ] {
            let button = ui.add_enabled(app.can(action), Button::new(text));
            if button.on_hover_text(action.help()).clicked() {
                app.perform(action, &ctx);
            }
        }
    });
}

/// Place, turn and size of the chosen object.
fn edit(ui: &mut Ui, app: &mut App, diameter: f64) {
    let Some(object) = app.insertions.chosen() else {
        return;
    };
    let placement = &mut object.placement;
    Grid::new("placement").num_columns(2).show(ui, |ui| {
        ui.label("Place").on_hover_text(
            "Where the middle of the object's base stands, in the capture's coordinates",
        );
        ui.horizontal(|ui| {
            let mut at = placement.at.unwrap_or(DVec3::ZERO);
            let mut changed = false;
            for (axis, value) in ["x", "y", "z"].into_iter().zip(at.as_mut()) {
                let drag = DragValue::new(value)
                    .speed(diameter * 1e-3)
                    .max_decimals(3)
                    .prefix(format!("{axis} "));
                let response = ui.add(drag);
                response.widget_info(|| {
                    egui::WidgetInfo::labeled(egui::Role::SpinButton, true, format!("Place {axis}"))
                });
                changed |= response.changed();
            }
            if changed {
                placement.at = Some(at);
            }
            if ui
                .add_enabled(placement.at.is_some(), Button::new("As modelled"))
                .on_hover_text("Takes the file's own coordinates for the capture's")
                .clicked()
            {
                placement.at = None;
            }
        });
        ui.end_row();
        for (title, value, range, speed, unit, help) in [
            (
                "Turn",
                &mut placement.rotate,
                -360.0..=360.0,
                1.0,
                "°",
                "Counter-clockwise from above",
            ),
            (
                "Scale",
                &mut placement.scale,
                1e-6..=1e6,
                0.01,
                "×",
                "Factor on the file's size; 0.01 for files in centimetres",
            ),
        ] {
            ui.label(title).on_hover_text(help);
            let speed = if title == "Scale" {
                value.abs() * speed
            } else {
                speed
            };
            let drag = DragValue::new(value)
                .range(range)
                .speed(speed)
                .max_decimals(4)
                .suffix(format!(" {unit}"));
            let response = ui.add(drag);
            response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::SpinButton, true, title));
            ui.end_row();
        }
    });
}

/// How large the chosen object is.
fn size(ui: &mut Ui, app: &mut App) {
    let Some(object) = app.insertions.chosen().cloned() else {
        return;
    };
    let placement = &object.placement;
    if let Some(size) = app.insertions.models.size(&placement.file) {
        let [width, height, depth] = (size * placement.scale).to_array();
        ui.weak(format!(
            "{width:.2} m wide, {height:.2} m high, {depth:.2} m deep"
        ));
    }
}

/// The ways to look at what came out.
fn results(ui: &mut Ui, app: &mut App) {
    let ctx = ui.ctx().clone();
    ui.horizontal_wrapped(|ui| {
        for action in [
            Action::NaiveBesideOurs,
            Action::WipeNaiveOurs,
            Action::BeforeAfter,
        ] {
            if ui
                .button(action.text())
                .on_hover_text(action.help())
                .clicked()
            {
                app.perform(action, &ctx);
            }
        }
    });
    ui.checkbox(
        &mut app.insertions.finish,
        "Blur and grain of the photograph",
    )
    .on_hover_text(
        "Makes objects as soft and as grainy as the 8-bit photograph that they are put into",
    );
}
