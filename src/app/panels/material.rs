//! The selected object's colour, light and gloss, changed by hand.

use crate::app::action::Action;
use crate::app::controls::{color_button, number_field, switched, when_left};
use crate::app::document::Document;
use crate::app::number::{number, triple};
use crate::app::request::{Request, Requests};
use crate::app::theme;
use crate::app::view::Parts;
use crate::inverse::estimate::{Estimate, ObjectEstimate};
use crate::scene::Scene;
use crate::session::edits::ObjectEdit;
use crate::transport::material::DIELECTRIC;
use egui::{Button, Grid, Role, Ui};
use glam::Vec3;

const CHANNELS: [&str; 3] = ["red", "green", "blue"];

pub fn pane(ui: &mut Ui, parts: &mut Parts<'_>, scene: &Scene) {
    let (document, requests) = (parts.document, &mut *parts.requests);
    let selected = parts.view.selection.object;
    let Some(object) = selected.map(|object| object as usize) else {
        ui.weak("Select an object by a click in a picture or in the table");
        buttons(ui, requests, &[Action::ResetEdits]);
        return;
    };
    let named = scene.objects.get(object);
    let known = named.zip(document.snapshot.estimate.objects.get(object));
    let Some((named, found)) = known else {
        ui.weak("Nothing is known of this object yet");
        return;
    };
    let before = document.edits.object(object);
    let mut edit = before;
    ui.horizontal(|ui| {
        ui.strong(&named.name);
        if before != ObjectEdit::default() {
            ui.colored_label(theme::tokens(ui).warning, "edited");
        }
    });
    Grid::new("material").num_columns(2).show(ui, |ui| {
        albedo(ui, found, &mut edit);
        ui.end_row();
        emission(ui, document, found, &mut edit);
        ui.end_row();
        gloss(ui, found, &mut edit);
        ui.end_row();
    });
    if edit != before {
        requests.ask(Request::Edit(object, edit));
    }
    let actions = [
        Action::SwitchLamp,
        Action::SolveOn,
        Action::ResetMaterial,
        Action::ResetEdits,
    ];
    buttons(ui, requests, &actions);
    let gloss = match found.lobe() {
        Some((roughness, specular)) => {
            let (roughness, specular) = (number(roughness), number(specular));
            format!("roughness {roughness}, specular reflectance {specular}")
        }
        None => "no gloss".to_owned(),
    };
    let (albedo, emission) = (triple(found.albedo), triple(found.emission));
    let unit = document.radiance_unit();
    ui.weak(format!(
        "found: albedo {albedo}, emission {emission} {unit}, {gloss}"
    ));
}

fn albedo(ui: &mut Ui, found: &ObjectEstimate, edit: &mut ObjectEdit) {
    let help = "Diffuse reflectance, 0 to 1 (no unit), linear; replaces a texture by one colour";
    ui.label("Albedo").on_hover_text(help);
    ui.horizontal(|ui| {
        let mut albedo = edit.albedo(found.albedo);
        let mut changed = color_button(ui, "Albedo colour", help, &mut albedo);
        for (channel, value) in CHANNELS.into_iter().zip(albedo.as_mut()) {
            let name = format!("Albedo {channel}");
            changed |= number_field(ui, [&name, help], value, 3, |drag| {
                let drag = when_left(drag).range(0.0..=1.0).speed(0.005);
                drag.prefix(format!("{} ", &channel[..1]))
            });
        }
        if changed {
            edit.albedo = Some(albedo);
        }
        if pin(ui, "Pin albedo", &mut edit.albedo_known) {
            edit.albedo.get_or_insert(albedo);
        }
    });
}

/// A switch that holds a value while the rest is solved; true when it is switched on.
fn pin(ui: &mut Ui, name: &str, known: &mut bool) -> bool {
    let help = "Known: held at this value by the next “Solve on with pinned values”, Reset or Run";
    let response = ui.checkbox(known, "Pin").on_hover_text(help);
    switched(response, Role::CheckBox, *known, name).changed() && *known
}

/// Strength and colour of its light.
fn emission(ui: &mut Ui, document: &Document, found: &ObjectEstimate, edit: &mut ObjectEdit) {
    let help = "Emitted radiance of the strongest channel";
    ui.label("Emission").on_hover_text(help);
    ui.horizontal(|ui| {
        let mut strength = edit.emission(found.emission).max_element();
        // A lamp that is off keeps the colour that it has when on.
        let mut on = *edit;
        on.off = false;
        let lit = on.emission(found.emission);
        let peak = lit.max_element();
        let mut color = if peak > 0.0 { lit / peak } else { Vec3::ONE };
        let mut changed = ui
            .add_enabled_ui(strength > 0.0, |ui| {
                let help = "Colour of the light at its strength (no unit), linear";
                color_button(ui, "Emission colour", help, &mut color)
            })
            .inner;
        let speed = drag_speed(&document.snapshot.estimate, strength);
        let unit = format!(" {}", document.radiance_unit());
        let named = ["Emission strength", help];
        changed |= number_field(ui, named, &mut strength, 4, |drag| {
            when_left(drag).range(0.0..=1e12).speed(speed).suffix(unit)
        });
        if changed {
            // A colour is as strong as its strongest channel.
            let peak = color.max_element();
            let pure = if peak > 0.0 { color / peak } else { Vec3::ZERO };
            edit.emission = Some(pure * strength);
            edit.off = false;
        }
        if pin(ui, "Pin emission", &mut edit.emission_known) {
            edit.emission.get_or_insert(found.emission);
        }
    });
}

/// The rough specular lobe over the surface's colour.
fn gloss(ui: &mut Ui, found: &ObjectEstimate, edit: &mut ObjectEdit) {
    let help = "A specular lobe (GGX) over the albedo: what shines";
    ui.label("Gloss").on_hover_text(help);
    ui.horizontal(|ui| {
        let lobe = edit.lobe(found.lobe());
        let mut glossy = lobe.is_some();
        let response = ui.checkbox(&mut glossy, "").on_hover_text(help);
        if switched(response, Role::CheckBox, glossy, "Gloss").changed() {
            // Back to what was found, where that is glossy or dull as asked.
            (edit.roughness, edit.specular) = (None, None);
            if found.lobe().is_some() != glossy {
                edit.specular = Some(if glossy { DIELECTRIC } else { 0.0 });
            }
        }
        let Some((mut roughness, mut specular)) = lobe else {
            ui.weak("none, dull");
            return;
        };
        let value = |ui: &mut Ui, value: &mut f32, name, range, help| {
            number_field(ui, [name, help], value, 3, |drag| {
                let drag = when_left(drag).range(range).speed(0.005);
                drag.prefix(format!("{name} "))
            })
        };
        let help = "GGX roughness α (no unit): near 0 a mirror, 1 as dull as gloss can be";
        if value(ui, &mut roughness, "roughness", 0.01..=1.0, help) {
            edit.roughness = Some(roughness);
        }
        let help = "Fraction of the light reflected straight on (no unit): 0.04 plastic, paint and wood, 0.5 and more metal";
        if value(ui, &mut specular, "specular", 0.001..=1.0, help) {
            edit.specular = Some(specular);
        }
    });
}

/// Radiance that a drag of one point adds: a fraction of the object's emission, or of the brightest lamp's if that is more.
fn drag_speed(estimate: &Estimate, strength: f32) -> f64 {
    let emissions = estimate.objects.iter().map(|o| o.emission.max_element());
    let brightest = emissions.fold(0.0f32, f32::max);
    f64::from((strength * 0.01).max(brightest * 1e-3).max(1e-6))
}

fn buttons(ui: &mut Ui, requests: &mut Requests, actions: &[Action]) {
    ui.horizontal_wrapped(|ui| {
        for &action in actions.iter().chain(&[Action::Undo, Action::Redo]) {
            requests.button(ui, action, Button::new(action.text()));
        }
    });
}
