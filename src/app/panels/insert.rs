//! Putting objects into the photographs: adding, placing, moving, turning, scaling, and the two results.

use crate::app::action::Action;
use crate::app::controls::{color_button, number_field, path_field, point, switched};
use crate::app::insertion::handles::SCALES;
use crate::app::insertion::{Adding, Insertions, name};
use crate::app::request::{Request, Requests};
use crate::app::shell::dialogs::Ask;
use crate::app::theme;
use crate::app::view::Parts;
use crate::compose::object::surface::MaterialOverride;
use crate::compose::placement::Placement;
use crate::scene::Scene;
use egui::{Button, Checkbox, Grid, Role, Ui};
use glam::DVec3;
use std::path::PathBuf;

pub fn pane(ui: &mut Ui, parts: &mut Parts<'_>, scene: &Scene) {
    let (insertions, requests) = (&parts.document.insertions, &mut *parts.requests);
    let adding = &mut parts.view.panels.adding;
    add(ui, adding, requests);
    if let Some(problem) = &adding.problem {
        ui.colored_label(theme::tokens(ui).error, problem);
    }
    if insertions.objects.is_empty() {
        ui.add_space(theme::GAP);
        ui.weak("OBJ and GLB files can also be dropped on the window. Then click where the object should stand.");
        return;
    }
    ui.separator();
    list(ui, insertions, requests);
    ui.separator();
    actions(ui, parts.view.tool.placing, requests);
    if let Some((index, object)) = insertions.chosen() {
        let mut edited = object.clone();
        edit(ui, &mut edited, f64::from(scene.diameter));
        let found = insertions.models.material(&edited.file);
        material(ui, found.unwrap_or_default(), &mut edited.material);
        if let Some(size) = insertions.models.size(&edited.file) {
            let [width, height, depth] = (size * edited.scale).to_array();
            ui.weak(format!(
                "{width:.2} m wide, {height:.2} m high, {depth:.2} m deep"
            ));
        }
        if edited != *object {
            requests.ask(Request::Place(index, edited));
        }
    }
    ui.separator();
    results(ui, insertions.finish, requests);
}

fn add(ui: &mut Ui, adding: &mut Adding, requests: &mut Requests) {
    ui.horizontal(|ui| {
        let width = (ui.available_width() - 210.0).max(60.0);
        let (field, entered) = path_field(ui, "Object file", &mut adding.path, "chair.glb", width);
        if std::mem::take(&mut adding.typing) {
            field.request_focus();
        }
        let add = ui.button("Add");
        let add = add.on_hover_text("Adds the object whose path is typed");
        let path = adding.path.trim();
        if (entered || add.clicked()) && !path.is_empty() {
            requests.ask(Request::Insert(PathBuf::from(path)));
        }
        let browse = ui.button("Browse…");
        let browse = browse.on_hover_text("Chooses an object with a file dialog");
        if browse.clicked() {
            requests.ask(Request::Browse(Ask::Object));
        }
    });
}

fn list(ui: &mut Ui, insertions: &Insertions, requests: &mut Requests) {
    for (index, object) in insertions.objects.iter().enumerate() {
        ui.horizontal(|ui| {
            let (name, number) = (name(object), index + 1);
            let mut visible = !object.hidden;
            let shown = ui
                .add(Checkbox::without_text(&mut visible))
                .on_hover_text("Shows or hides the object");
            let show = format!("Show {name} {number}");
            if switched(shown, Role::CheckBox, visible, &show).changed() {
                requests.ask(Request::Hide(index, !visible));
            }
            let chosen = insertions.chosen == Some(index);
            let row = ui.selectable_label(chosen, format!("{number}  {name}"));
            if row.clicked() {
                requests.ask(Request::Choose(index));
            }
            if object.at.is_none() {
                ui.weak("as modelled");
            }
        });
    }
}

fn actions(ui: &mut Ui, placing: bool, requests: &mut Requests) {
    ui.horizontal_wrapped(|ui| {
        let text = match placing {
            true => "Click in a view…",
            false => "Place by click",
        };
        requests.button(ui, Action::Place, Button::new(text).selected(placing));
        for (action, text) in [
            (Action::Duplicate, "Duplicate"),
            (Action::Delete, "Delete"),
            (Action::Undo, "Undo"),
            (Action::Redo, "Redo"),
        ] {
            requests.button(ui, action, Button::new(text));
        }
    });
}

/// Place, turn and size of an object.
fn edit(ui: &mut Ui, object: &mut Placement, diameter: f64) {
    Grid::new("placement").num_columns(2).show(ui, |ui| {
        let help = "Where the middle of the object's base stands, in the capture's coordinates";
        ui.label("Place").on_hover_text(help);
        ui.horizontal(|ui| {
            let mut at = object.at.unwrap_or(DVec3::ZERO);
            if point(ui, "Place", &mut at, diameter * 1e-3) {
                object.at = Some(at);
            }
            let as_modelled = Button::new("As modelled");
            let as_modelled = ui.add_enabled(object.at.is_some(), as_modelled);
            let help = "Takes the file's own coordinates for the capture's";
            if as_modelled.on_hover_text(help).clicked() {
                object.at = None;
            }
        });
        ui.end_row();
        ui.label("Turn")
            .on_hover_text("Counter-clockwise from above");
        degrees(ui, "Turn", "", &mut object.rotate);
        ui.end_row();
        let help =
            "About the object's own x and z axes, before the turn; it stands on its lowest point";
        ui.label("Tilt").on_hover_text(help);
        ui.horizontal(|ui| {
            for (axis, tilt) in ["x", "z"].into_iter().zip(object.tilt.as_mut()) {
                degrees(ui, &format!("Tilt {axis}"), &format!("{axis} "), tilt);
            }
        });
        ui.end_row();
        ui.label("Scale")
            .on_hover_text("Factor on the file's size; 0.01 for files in centimetres");
        let speed = object.scale.abs() * 0.01;
        number_field(ui, ["Scale", ""], &mut object.scale, 4, |drag| {
            drag.range(SCALES.0..=SCALES.1).speed(speed).suffix(" ×")
        });
        ui.end_row();
    });
}

fn degrees(ui: &mut Ui, name: &str, prefix: &str, angle: &mut f64) {
    number_field(ui, [name, ""], angle, 4, |drag| {
        let drag = drag.range(-360.0..=360.0).speed(1.0);
        drag.prefix(prefix).suffix(" °")
    });
}

/// The material in place of those of the file; `found` is the file's main one.
fn material(ui: &mut Ui, found: MaterialOverride, material: &mut Option<MaterialOverride>) {
    let help = "One material for the whole object, in place of those of its file";
    let mut own = material.is_some();
    let response = ui.checkbox(&mut own, "Own material").on_hover_text(help);
    if switched(response, Role::CheckBox, own, "Own material").changed() {
        *material = own.then_some(found);
    }
    let Some(material) = material else {
        return;
    };
    ui.horizontal_wrapped(|ui| {
        let help = "Base colour (no unit), linear";
        color_button(ui, "Object colour", help, &mut material.base_color);
        let mut glossy = material.roughness.is_some();
        let response = ui.checkbox(&mut glossy, "Gloss");
        if switched(response, Role::CheckBox, glossy, "Object gloss").changed() {
            material.roughness = glossy.then_some(MaterialOverride::GLOSS);
        }
        let Some(roughness) = &mut material.roughness else {
            material.metallic = 0.0;
            return;
        };
        for (name, value, help) in [
            (
                "roughness",
                roughness,
                "GGX roughness α (no unit): near 0 a mirror, 1 as dull as gloss can be",
            ),
            (
                "metallic",
                &mut material.metallic,
                "0 for plastic, paint and wood, 1 for metal (no unit)",
            ),
        ] {
            let label = format!("Object {name}");
            number_field(ui, [&label, help], value, 3, |drag| {
                let drag = drag.range(0.0..=1.0).speed(0.005);
                drag.prefix(format!("{name} "))
            });
        }
    });
}

/// The ways to look at what came out.
fn results(ui: &mut Ui, finish: bool, requests: &mut Requests) {
    ui.horizontal_wrapped(|ui| {
        for action in [
            Action::NaiveBesideOurs,
            Action::WipeNaiveOurs,
            Action::BeforeAfter,
        ] {
            requests.button(ui, action, Button::new(action.text()));
        }
    });
    let mut wanted = finish;
    let help = "Makes objects as soft and as grainy as the 8-bit photograph that they are put into";
    let finish = ui.checkbox(&mut wanted, "Blur and grain of the photograph");
    if finish.on_hover_text(help).changed() {
        requests.ask(Request::Finish(wanted));
    }
}
