//! The selected object's colour, light and gloss, changed by hand.

use crate::app::action::Action;
use crate::app::panels::color;
use crate::app::picture::inspect::{number, triple};
use crate::app::state::App;
use crate::app::theme;
use crate::inverse::estimate::ObjectEstimate;
use crate::session::edits::ObjectEdit;
use crate::transport::material::DIELECTRIC;
use egui::{Button, DragValue, Grid, Role, ScrollArea, Ui, WidgetInfo};
use glam::Vec3;

/// Names of the channels.
const CHANNELS: [&str; 3] = ["red", "green", "blue"];

/// Draws the pane.
pub fn pane(ui: &mut Ui, app: &mut App) {
    if !app.is_steady() {
        ui.weak("Reading the mesh again…");
        return;
    }
    let Some(capture) = app.capture().cloned() else {
        ui.weak(app.nothing_open());
        return;
    };
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        let Some(object) = app.selected.map(|object| object as usize) else {
            ui.weak("Select an object by a click in a picture or in the table");
            buttons(ui, app, &[Action::ResetEdits]);
            return;
        };
        let estimate = app.snapshot.estimate.clone();
        let name = capture.scene.objects.get(object);
        let Some((name, found)) = name.zip(estimate.objects.get(object)) else {
            ui.weak("Nothing is known of this object yet");
            return;
        };
        let before = app.edits.object(object);
        let mut edit = before;
        ui.horizontal(|ui| {
            ui.strong(&name.name);
            if before != ObjectEdit::default() {
                ui.colored_label(theme::tokens(ui).warning, "edited");
            }
        });
        Grid::new("material").num_columns(2).show(ui, |ui| {
            albedo(ui, found, &mut edit);
            ui.end_row();
            emission(ui, app, found, &mut edit);
            ui.end_row();
            gloss(ui, found, &mut edit);
            ui.end_row();
        });
        if edit != before {
            app.edits.set(object, edit);
            ui.ctx().request_repaint();
        }
        buttons(
            ui,
            app,
            &[
                Action::SwitchLamp,
                Action::SolveOn,
                Action::ResetMaterial,
                Action::ResetEdits,
            ],
        );
        let gloss = match found.lobe() {
            Some((roughness, specular)) => format!(
                "roughness {}, specular reflectance {}",
                number(roughness),
                number(specular)
            ),
            None => "no gloss".to_owned(),
        };
        ui.weak(format!(
            "found: albedo {}, emission {} {}, {gloss}",
            triple(found.albedo),
            triple(found.emission),
            app.radiance_unit()
        ));
    });
}

/// Colour of the surface.
fn albedo(ui: &mut Ui, found: &ObjectEstimate, edit: &mut ObjectEdit) {
    let help = "Diffuse reflectance, 0 to 1 (no unit), linear; replaces a texture by one colour";
    ui.label("Albedo").on_hover_text(help);
    ui.horizontal(|ui| {
        let mut albedo = edit.albedo(found.albedo);
        let mut changed = color::well(ui, "Albedo colour", help, &mut albedo);
        for (channel, value) in CHANNELS.into_iter().zip(albedo.as_mut()) {
            let drag = DragValue::new(value)
                .range(0.0..=1.0)
                .speed(0.005)
                .max_decimals(3)
                .prefix(format!("{} ", &channel[..1]))
                .update_while_editing(false);
            let response = ui.add(drag).on_hover_text(help);
            response.widget_info(|| {
                WidgetInfo::labeled(Role::SpinButton, true, format!("Albedo {channel}"))
            });
            changed |= response.changed();
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
    response.widget_info(|| WidgetInfo::selected(Role::CheckBox, true, *known, name));
    response.changed() && *known
}

/// Strength and colour of its light.
fn emission(ui: &mut Ui, app: &App, found: &ObjectEstimate, edit: &mut ObjectEdit) {
    let help = "Emitted radiance of the strongest channel";
    ui.label("Emission").on_hover_text(help);
    ui.horizontal(|ui| {
        let mut strength = edit.emission(found.emission).max_element();
        // A lamp that is off keeps the colour that it has when on.
        let lit = ObjectEdit {
            off: false,
            ..*edit
        }
        .emission(found.emission);
        let peak = lit.max_element();
        let mut color = if peak > 0.0 { lit / peak } else { Vec3::ONE };
        let mut changed = ui
            .add_enabled_ui(strength > 0.0, |ui| {
                let help = "Colour of the light at its strength (no unit), linear";
                color::well(ui, "Emission colour", help, &mut color)
            })
            .inner;
        let speed = drag_speed(app, strength);
        let drag = DragValue::new(&mut strength)
            .range(0.0..=1e12)
            .speed(speed)
            .max_decimals(4)
            .suffix(format!(" {}", app.radiance_unit()))
            .update_while_editing(false);
        let response = ui.add(drag).on_hover_text(help);
        response.widget_info(|| WidgetInfo::labeled(Role::SpinButton, true, "Emission strength"));
        changed |= response.changed();
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
        response.widget_info(|| WidgetInfo::selected(Role::CheckBox, true, glossy, "Gloss"));
        if response.changed() {
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
            let drag = DragValue::new(value)
                .range(range)
                .speed(0.005)
                .max_decimals(3)
                .prefix(format!("{name} "))
                .update_while_editing(false);
            let response = ui.add(drag).on_hover_text(help);
            response.widget_info(|| WidgetInfo::labeled(Role::SpinButton, true, name));
            response.changed()
        };
        let help = "GGX roughness α (no unit): near 0 a mirror, 1 as dull as gloss can be";
        if value(ui, &mut roughness, "roughness", 0.01..=1.0, help) {
            edit.roughness = Some(roughness);
        }
        let help = "Share of the light reflected straight on (no unit): 0.04 plastic, paint and wood, 0.5 and more metal";
        if value(ui, &mut specular, "specular", 0.001..=1.0, help) {
            edit.specular = Some(specular);
        }
    });
}

/// Radiance a point of dragging: a fraction of the light itself, or of the brightest lamp where it is dark.
fn drag_speed(app: &App, strength: f32) -> f64 {
    let objects = app.snapshot.estimate.objects.iter();
    let brightest = objects
        .map(|o| o.emission.max_element())
        .fold(0.0f32, f32::max);
    f64::from((strength * 0.01).max(brightest * 1e-3).max(1e-6))
}

fn buttons(ui: &mut Ui, app: &mut App, actions: &[Action]) {
    let ctx = ui.ctx().clone();
    ui.horizontal_wrapped(|ui| {
        for &action in actions.iter().chain(&[Action::Undo, Action::Redo]) {
            let button = ui.add_enabled(app.can(action), Button::new(action.text()));
            if button.on_hover_text(action.help()).clicked() {
                app.perform(action, &ctx);
            }
        }
    });
}
