//! The solver's parameters: widgets made from the one table that declares them.

use crate::app::controls::named;
use crate::app::number::capitalized;
use crate::app::request::{Request, Requests};
use crate::app::theme;
use crate::inverse::settings::{Kind, PARAMETERS, Parameter, Settings, Value};
use crate::session::snapshot::Level;
use egui::{Checkbox, ComboBox, DragValue, Grid, Role, Ui};

pub fn pane(ui: &mut Ui, before: &Settings, requests: &mut Requests) {
    let mut settings = before.clone();
    let grid = Grid::new("settings").num_columns(3).striped(true);
    grid.show(ui, |ui| {
        for parameter in PARAMETERS {
            let before = parameter.get(&settings);
            let title = capitalized(&parameter.name.replace('_', " "));
            let help = help(parameter);
            ui.label(&title).on_hover_text(&help);
            let mut value = before.clone();
            ui.push_id(parameter.name, |ui| {
                widget(ui, parameter, &title, &mut value);
            });
            ui.horizontal(|ui| {
                if !parameter.unit.is_empty() {
                    ui.weak(parameter.unit);
                }
                if parameter.live {
                    ui.colored_label(theme::tokens(ui).good, "live")
                        .on_hover_text("Takes effect at once");
                }
            });
            ui.end_row();
            if value != before
                && let Err(message) = parameter.set(&mut settings, &value)
            {
                requests.ask(Request::Say(Level::Warning, message));
            }
        }
    });
    ui.add_space(theme::GAP);
    ui.weak("What is not live takes effect at the next reset.");
    if settings != *before {
        requests.ask(Request::Set(Box::new(settings)));
    }
}

/// Help, unit and range.
fn help(parameter: &Parameter) -> String {
    format!("{}.\nAllowed: {}.", parameter.help, parameter.allowed())
}

fn widget(ui: &mut Ui, parameter: &Parameter, title: &str, value: &mut Value) {
    let (response, role) = match (parameter.kind, value) {
        (Kind::Flag, Value::Flag(flag)) => (ui.add(Checkbox::without_text(flag)), Role::CheckBox),
        (Kind::Whole { min, max }, Value::Whole(n)) => {
            let drag = DragValue::new(n).range(min..=max).speed(0.1);
            (ui.add(automatic(drag, parameter)), Role::SpinButton)
        }
        (
            Kind::Real {
                min,
                max,
                logarithmic,
            },
            Value::Real(x),
        ) => {
            let speed = match logarithmic {
                true => (x.abs() * 0.01).max(1e-6),
                false => (max - min) * 1e-3,
            };
            let drag = DragValue::new(x).range(min..=max).speed(speed);
            let drag = automatic(drag.max_decimals(6), parameter);
            (ui.add(drag), Role::SpinButton)
        }
        (Kind::Choice(words), Value::Choice(word)) => {
            let list = ComboBox::from_id_salt("choice").width(96.0);
            let list = list.selected_text(word.as_str()).show_ui(ui, |ui| {
                for choice in words {
                    ui.selectable_value(word, (*choice).to_owned(), *choice);
                }
            });
            (list.response, Role::ComboBox)
        }
        (_, value) => (ui.label(format!("{value:?}")), Role::Label),
    };
    named(response, role, title).on_hover_text(help(parameter));
}

/// Says in words what 0 stands for, where that is no amount.
fn automatic<'a>(drag: DragValue<'a>, parameter: &Parameter) -> DragValue<'a> {
    let says = |phrases: &[&str]| phrases.iter().any(|phrase| parameter.help.contains(phrase));
    let words = if says(&["0 sets no limit", "0 goes on"]) {
        "no limit"
    } else if says(&["0 leaves", "0 chooses", "0 takes"]) {
        "automatic"
    } else {
        return drag;
    };
    drag.custom_formatter(move |value, _| match value == 0.0 {
        true => words.to_owned(),
        false => value.to_string(),
    })
    .custom_parser(move |text| match text.trim() {
        text if text == words => Some(0.0),
        text => text.parse().ok(),
    })
}
