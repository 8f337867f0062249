//! The tool bar: the solver, the photograph, and how pictures are shown.

use crate::app::action::Action;
use crate::app::controls::{choose, named};
use crate::app::picture::look::Look;
use crate::app::request::Requests;
use crate::app::theme;
use crate::app::view::Parts;
use egui::{Button, Key, Role, Slider, Ui, vec2};

pub fn bar(ui: &mut Ui, parts: &mut Parts<'_>) {
    let (document, requests) = (parts.document, &mut *parts.requests);
    let (shown, look) = (&parts.view.shown, &mut parts.view.look);
    ui.horizontal_wrapped(|ui| {
        let run = match document.is_running() {
            true => "Pause",
            false => "Run",
        };
        button(ui, requests, Action::RunPause, run, 52.0);
        button(ui, requests, Action::Step, "Step", 0.0);
        button(ui, requests, Action::Finish, "Finish", 0.0);
        button(ui, requests, Action::Reset, "Reset", 0.0);
        ui.separator();
        button(ui, requests, Action::PreviousFrame, "‹", 22.0);
        let text = match (shown.photograph(), document.frames()) {
            (None, _) => "3D view".to_owned(),
            (_, 0) => "no photograph".to_owned(),
            (Some(frame), frames) => format!("photograph {} of {frames}", frame + 1),
        };
        let centered = egui::Layout::centered_and_justified(egui::Direction::LeftToRight);
        let size = vec2(132.0, theme::ROW);
        ui.allocate_ui_with_layout(size, centered, |ui| ui.label(text));
        button(ui, requests, Action::NextFrame, "›", 22.0);
        ui.separator();
        exposure(ui, look, requests);
        ui.separator();
        button(ui, requests, Action::FitPictures, "Fit", 0.0);
        let hold = Button::new("Hold: photograph").sense(egui::Sense::drag());
        let help = "While the button or the key P is down all pictures show the photograph";
        let hold = ui.add(hold).on_hover_text(help);
        let key = !ui.ctx().text_edit_focused()
            && ui.input(|input| input.key_down(Key::P) && !input.modifiers.command);
        look.photograph = hold.is_pointer_button_down_on() || key;
        let from_here = Button::new("From 3D view").selected(shown.free.is_some());
        requests.button(ui, Action::RenderFromHere, from_here);
    });
}

/// A button for an action, named for people who cannot see its glyph.
fn button(ui: &mut Ui, requests: &mut Requests, action: Action, text: &str, width: f32) {
    let keys = action.keys(ui.ctx());
    let help = match keys.is_empty() {
        true => action.help().to_owned(),
        false => format!("{} ({keys})", action.help()),
    };
    let button = Button::new(text).min_size(vec2(width, theme::ROW));
    let response = requests.button_with_help(ui, action, button, &help);
    if !text.is_ascii() {
        named(response, Role::Button, action.text());
    }
}

fn exposure(ui: &mut Ui, look: &mut Look, requests: &mut Requests) {
    let label = ui
        .label("Exposure")
        .on_hover_text("Stops: radiance is multiplied by 2 to this power");
    let slider = Slider::new(&mut look.exposure, -12.0..=12.0).step_by(0.05);
    ui.add(slider.fixed_decimals(2).suffix(" EV"))
        .labelled_by(label.id);
    button(ui, requests, Action::AutoExposure, "Auto", 0.0);
    choose(ui, "Tone curve", 104.0, &mut look.tone);
}
