//! The paper's experiments: which there are, how to run them, and their plot while it grows.

use crate::app::action::Action;
use crate::app::panels::plot;
use crate::app::state::App;
use crate::app::studies::{OWN_ROOMS, Plan};
use crate::app::theme;
use crate::study::experiments::STUDIES;
use egui::{Button, ComboBox, DragValue, ScrollArea, TextEdit, Ui};

/// Least height of the plot, in points of the screen.
const PLOT: f32 = 190.0;

/// How studies run on a capture.
const ON_CAPTURE: &str = "batch and textures on its photographs; the others on its twin, a room with its mesh, its views and \
    the colours and lamps found in it, whose truth is known";

/// Draws the pane.
pub fn pane(ui: &mut Ui, app: &mut App) {
    let running = app.studies.doing();
    ui.add_enabled_ui(running.is_none(), |ui| choice(ui, app));
    start(ui, app, running);
    ui.separator();
    let Some(shown) = app.studies.shown.clone() else {
        ui.weak("Nothing was run yet");
        return;
    };
    ui.horizontal_wrapped(|ui| {
        ui.strong(shown.study.name);
        ui.weak(format!("on {}", shown.on));
    });
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        match &shown.plot {
            Some(shown) => {
                let height = (ui.available_height() - theme::ROW).max(PLOT);
                plot::show(ui, "study", shown, height);
            }
            None => {
                ui.weak("The plot appears with the first values");
            }
        }
        for sentence in &shown.seen {
            ui.label(format!("• {sentence}"));
        }
        if let Some(folder) = &shown.folder {
            ui.weak(format!("All values are in {}", folder.display()));
        }
    });
}

/// Which study, and how.
fn choice(ui: &mut Ui, app: &mut App) {
    let open = app.capture().map(|capture| capture.name.clone());
    let Plan {
        study,
        seconds,
        seeds,
        own_rooms,
        quick,
        folder,
    } = &mut app.studies.plan;
    ui.horizontal_wrapped(|ui| {
        let label = ui.label("Study");
        ComboBox::from_id_salt("study")
            .selected_text(STUDIES[*study].name)
            .width(120.0)
            .show_ui(ui, |ui| {
                for (index, each) in STUDIES.iter().enumerate() {
                    ui.selectable_value(study, index, each.name)
                        .on_hover_text(each.question);
                }
            })
            .response
            .labelled_by(label.id);
        match &open {
            Some(name) => {
                ui.radio_value(own_rooms, false, format!("on the open capture, {name}"))
                    .on_hover_text(ON_CAPTURE);
                ui.radio_value(own_rooms, true, format!("on {OWN_ROOMS}"))
                    .on_hover_text("Rooms whose truth is known, each made for what the study asks");
            }
            None => {
                ui.weak(format!("on {OWN_ROOMS}"));
            }
        }
    });
    ui.label(STUDIES[*study].question);
    ui.horizontal(|ui| {
        let label = ui.label("In");
        ui.add_enabled(
            !*quick,
            DragValue::new(seconds).range(5.0..=36_000.0).suffix(" s"),
        )
        .labelled_by(label.id)
        .on_hover_text("Time for all solves together; making scenes and measuring comes on top");
        let label = ui.label("Seeds");
        ui.add(DragValue::new(seeds).range(1..=100))
            .labelled_by(label.id)
            .on_hover_text("How often each solve is repeated with other random numbers");
        ui.checkbox(quick, "Quick")
            .on_hover_text("Only tries it: fewer values, smaller scenes, solves cut short");
        let label = ui.label("into");
        ui.add(TextEdit::singleline(folder).desired_width(f32::INFINITY))
            .labelled_by(label.id)
            .on_hover_text("Folder for NAME.csv, NAME.png and NAME.md; those on a capture go into one of its name there");
    });
}

/// The button that starts and ends, and what it is at.
fn start(ui: &mut Ui, app: &mut App, running: Option<String>) {
    let ctx = ui.ctx().clone();
    ui.horizontal(|ui| {
        let text = match running {
            Some(_) => "Cancel study",
            None => "Start study",
        };
        let button = ui.add_enabled(app.can(Action::RunStudy), Button::new(text));
        let disabled =
            "Run only while neither a solve nor a measurement does: pause it or let it end";
        if button
            .on_hover_text(Action::RunStudy.help())
            .on_disabled_hover_text(disabled)
            .clicked()
        {
            app.perform(Action::RunStudy, &ctx);
        }
        match running {
            Some(doing) => {
                ui.spinner();
                let seconds = app.studies.seconds();
                ui.label(format!("{doing} · {seconds:.0} s"));
                ctx.request_repaint_after(std::time::Duration::from_secs(1));
            }
            None if !app.can(Action::RunStudy) => {
                ui.weak("while nothing else is solved");
            }
            None => {}
        }
    });
}
