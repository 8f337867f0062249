//! A switch, a strength and a colour for every lamp.

use crate::app::action::Action;
use crate::app::controls::{color_button, number_field, switched, when_left};
use crate::app::document::Document;
use crate::app::lights::place;
use crate::app::request::{Request, Requests};
use crate::app::view::Parts;
use crate::export::light_layers;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::session::snapshot::LightSource;
use egui::{Button, Checkbox, Grid, Role, Slider, SliderClamping, Ui, WidgetInfo};

/// The strength at the end of a slider; a larger one can be typed.
const MAX: f32 = 4.0;

pub fn pane(ui: &mut Ui, parts: &mut Parts<'_>, scene: &Scene) {
    let (document, requests) = (parts.document, &mut *parts.requests);
    let camera = parts.view.shown.camera(document);
    let selected = parts.view.selection.object;
    let lamps = document.lamps();
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
            requests.button(ui, action, Button::new(text));
        }
    });
    ui.separator();
    let grid = Grid::new("lights").num_columns(5).striped(true);
    grid.show(ui, |ui| {
        for (source, objects) in &lamps {
            let name = title(*source, scene, camera);
            light(ui, document, objects, &name, requests);
            let lamp = match source {
                LightSource::Lamp(object) => Some(*object),
                _ => None,
            };
            let label = ui
                .selectable_label(lamp.is_some() && selected == lamp, &name)
                .on_hover_text("Selects this lamp");
            requests.ask_all(lamp.filter(|_| label.clicked()).map(Request::Reveal));
            ui.end_row();
        }
    });
}

/// A lamp's name; that of a segment says where it is.
fn title(source: LightSource, scene: &Scene, camera: Option<&Camera>) -> String {
    let name = light_layers::name(source, scene);
    let place = match (source, camera) {
        (LightSource::Lamp(object), Some(camera)) if name.starts_with("segment ") => {
            place(scene, object, camera)
        }
        _ => None,
    };
    place.map_or_else(|| name.to_owned(), |place| format!("{name}, {place}"))
}

fn light(ui: &mut Ui, document: &Document, objects: &[usize], name: &str, requests: &mut Requests) {
    let before = document.gain(objects);
    let mut gain = before;
    let on = ui
        .add(Checkbox::without_text(&mut gain.on))
        .on_hover_text("Switches this light off and on");
    switched(on, Role::CheckBox, gain.on, &format!("{name} is lit"));
    let help =
        "Factor on red, green and blue of this light (no unit); white leaves its colour as it is";
    color_button(ui, &format!("Colour of {name}"), help, &mut gain.color);
    let help = "Factor on this light: 0 takes it away, 1 × is what was found";
    let slider = Slider::new(&mut gain.strength, 0.0..=MAX)
        .clamping(SliderClamping::Never)
        .show_value(false);
    let strength = ui.add(slider).on_hover_text(help);
    let named_strength = format!("Strength of {name}");
    strength.widget_info(|| WidgetInfo::slider(true, f64::from(gain.strength), &named_strength));
    let typed = format!("{named_strength}, typed");
    number_field(ui, [&typed, help], &mut gain.strength, 2, |drag| {
        let drag = when_left(drag).range(0.0..=f32::MAX);
        drag.speed(0.01).suffix(" ×")
    });
    if gain != before {
        requests.ask(Request::Light(objects.to_vec(), gain));
    }
}
