//! The tool bar: the solver, the photograph, and how pictures are shown.

use crate::app::action::Action;
use crate::app::picture::look::ToneCurve;
use crate::app::state::{App, Shown};
use crate::app::theme;
use egui::{Button, ComboBox, Slider, Ui, vec2};

/// Draws the bar.
pub fn bar(ui: &mut Ui, app: &mut App) {
    ui.horizontal_wrapped(|ui| {
        let run = if app.is_running() { "Pause" } else { "Run" };
        button(ui, app, Action::RunPause, run, 52.0);
        button(ui, app, Action::Step, "Step", 0.0);
        button(ui, app, Action::Finish, "Finish", 0.0);
        button(ui, app, Action::Reset, "Reset", 0.0);
        ui.separator();
        button(ui, app, Action::PreviousFrame, "‹", 22.0);
        let frames = app.frames();
        let text = match app.shown {
            Shown::Free(..) => "3D view".to_owned(),
            Shown::Frame if frames == 0 => "no photograph".to_owned(),
            Shown::Frame => format!("photograph {} of {frames}", app.frame + 1),
        };
        ui.allocate_ui_with_layout(
            vec2(132.0, theme::ROW),
            egui::Layout::centered_and_justified(egui::Direction::LeftToRight),
            |ui| ui.label(text),
        );
        button(ui, app, Action::NextFrame, "›", 22.0);
        ui.separator();
        exposure(ui, app);
        ui.separator();
        button(ui, app, Action::FitPictures, "Fit", 0.0);
        let hold = ui
            .add(Button::new("Hold: photograph").sense(egui::Sense::drag()))
            .on_hover_text(
                "While the button or the key P is down all pictures show the photograph",
            );
        let key = !ui.ctx().text_edit_focused()
            && ui.input(|input| input.key_down(egui::Key::P) && !input.modifiers.command);
        app.look.photograph = hold.is_pointer_button_down_on() || key;
        let free = matches!(app.shown, Shown::Free(..));
        let response = ui
            .add_enabled(
                app.can(Action::RenderFromHere),
                Button::new("From 3D view").selected(free),
            )
            .on_hover_text(Action::RenderFromHere.help());
        if response.clicked() {
            app.perform(Action::RenderFromHere, &ui.ctx().clone());
        }
    });
}

/// A button for an action, named for people who cannot see its glyph.
fn button(ui: &mut Ui, app: &mut App, action: Action, text: &str, width: f32) {
    let ctx = ui.ctx().clone();
    let keys = action.keys(&ctx);
    let help = if keys.is_empty() {
        action.help().to_owned()
    } else {
        format!("{} ({keys})", action.help())
    };
    let response = ui.add_enabled(
        app.can(action),
        Button::new(text).min_size(vec2(width, theme::ROW)),
    );
    if !text.is_ascii() {
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, action.text()));
    }
    if response.on_hover_text(help).clicked() {
        app.perform(action, &ctx);
    }
}

fn exposure(ui: &mut Ui, app: &mut App) {
    let label = ui
        .label("Exposure")
        .on_hover_text("Stops: radiance is multiplied by 2 to this power");
    ui.add(
        Slider::new(&mut app.look.exposure, -12.0..=12.0)
            .step_by(0.05)
            .fixed_decimals(2)
            .suffix(" EV"),
    )
    .labelled_by(label.id);
    button(ui, app, Action::AutoExposure, "Auto", 0.0);
    let response = ComboBox::from_id_salt("tone curve")
        .selected_text(app.look.tone.name())
        .width(104.0)
        .show_ui(ui, |ui| {
            for tone in ToneCurve::ALL {
                ui.selectable_value(&mut app.look.tone, tone, tone.name());
            }
        })
        .response;
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::ComboBox, true, "Tone curve"));
    app.preferences.tone = app.look.tone;
}
