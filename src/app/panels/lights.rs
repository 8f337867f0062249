//! A switch, a strength and a colour for every lamp.

use crate::app::action::Action;
use crate::app::lights::{Gain, place};
use crate::app::panels::color;
use crate::app::state::App;
use crate::export::light_layers;
use crate::scene::Scene;
use crate::session::snapshot::LightSource;
use egui::{
    Button, Checkbox, DragValue, Grid, Role, ScrollArea, Slider, SliderClamping, Ui, WidgetInfo,
};

/// The strength at the end of a slider; a larger one can be typed.
const MAX: f32 = 4.0;

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
    let ctx = ui.ctx().clone();
    let lamps = app.lamps();
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        if lamps.is_empty() {
            ui.weak("Nothing emits light in this estimate yet.");
            return;
        }
        ui.horizontal_wrapped(|ui| {
            for (action, text) in [
                (Action::BeforeAfter, "Before and after"),
                (Action::ResetLights, "Reset lights"),
                (Action::SaveLayers, "Save layers…"),
                (Action::Undo, "Undo"),
                (Action::Redo, "Redo"),
            ] {
                let button = ui.add_enabled(app.can(action), Button::new(text));
                if button.on_hover_text(action.help()).clicked() {
                    app.perform(action, &ctx);
                }
            }
        });
        ui.separator();
        Grid::new("lights")
            .num_columns(5)
            .striped(true)
            .show(ui, |ui| {
                for (source, objects) in &lamps {
                    let name = named(app, *source, &capture.scene);
                    row(ui, app, *source, objects, &name);
                    ui.end_row();
                }
            });
    });
}

/// A lamp's name; that of a segment says where it is.
fn named(app: &App, source: LightSource, scene: &Scene) -> String {
    let name = light_layers::name(source, scene);
    let place = match (source, app.camera()) {
        (LightSource::Lamp(object), Some(camera)) if name.starts_with("segment ") => {
            place(scene, object, camera)
        }
        _ => None,
    };
    place.map_or_else(|| name.to_owned(), |place| format!("{name}, {place}"))
}

/// One lamp.
fn row(ui: &mut Ui, app: &mut App, source: LightSource, objects: &[usize], name: &str) {
    let before = app.gain(objects);
    let mut gain: Gain = before;
    let on = ui
        .add(Checkbox::without_text(&mut gain.on))
        .on_hover_text("Switches this light off and on");
    on.widget_info(|| {
        WidgetInfo::selected(Role::CheckBox, true, gain.on, format!("{name} is lit"))
    });
    color::well(
        ui,
        &format!("Colour of {name}"),
        "Factor on red, green and blue of this light (no unit); white leaves its colour as it is",
        &mut gain.color,
    );
    let help = "Factor on this light: 0 takes it away, 1 × is what was found";
    let slider = Slider::new(&mut gain.strength, 0.0..=MAX)
        .clamping(SliderClamping::Never)
        .show_value(false);
    let strength = ui.add(slider).on_hover_text(help);
    strength.widget_info(|| {
        WidgetInfo::slider(
            true,
            f64::from(gain.strength),
            format!("Strength of {name}"),
        )
    });
    let number = DragValue::new(&mut gain.strength)
        .range(0.0..=f32::MAX)
        .speed(0.01)
        .max_decimals(2)
        .suffix(" ×")
        .update_while_editing(false);
    let typed = ui.add(number).on_hover_text(help);
    typed.widget_info(|| {
        WidgetInfo::labeled(Role::SpinButton, true, format!("Strength of {name}, typed"))
    });
    let lamp = match source {
        LightSource::Lamp(object) => Some(object),
        _ => None,
    };
    let selected = lamp.is_some() && app.selected == lamp;
    let label = ui
        .selectable_label(selected, name)
        .on_hover_text("Selects this lamp");
    if label.clicked() && lamp.is_some() {
        app.select(lamp, false);
    }
    if gain != before {
        app.set_gain(objects, gain);
        ui.ctx().request_repaint();
    }
}
