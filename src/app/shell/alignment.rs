//! What the window offers where photographs do not show the mesh from their poses.

use crate::app::state::App;
use crate::capture::reading::Reading;
use crate::session::command::Command;
use crate::session::snapshot::Phase;
use egui::{Align2, Context, Window};

/// Shows, as long as the solve has not begun, that the capture is read wrongly and how to read it.
pub fn show(app: &mut App, ctx: &Context) {
    let Some(capture) = app.capture().cloned() else {
        return;
    };
    let waits = app.snapshot.phase == Phase::Paused && app.snapshot.progress.iterations == 0;
    let Some(reading) = capture.other_reading().filter(|_| waits) else {
        return;
    };
    let Some(error) = (capture.alignment.as_ref())
        .and_then(|alignment| alignment.error(&capture.name, &capture.options.reading))
    else {
        return;
    };
    let mut options = None;
    let mut as_it_is = false;
    Window::new("The photographs do not fit the mesh")
        .anchor(Align2::CENTER_CENTER, [0.0, 0.0])
        .collapsible(false)
        .resizable(false)
        .show(ctx, |ui| {
            ui.set_max_width(460.0);
            ui.label(&error.problem);
            ui.add_space(8.0);
            ui.horizontal_wrapped(|ui| {
                if ui.button(button(&reading)).clicked() {
                    options = Some(crate::session::command::OpenOptions {
                        reading,
                        ..capture.options.clone()
                    });
                }
                as_it_is = ui.button("Solve as it is").clicked();
            });
        });
    if let Some(options) = options {
        app.send(Command::Reframe(Box::new(options)));
        app.send(Command::Run);
    } else if as_it_is {
        app.send(Command::Run);
    }
}

/// What the button that reads the capture so says.
fn button(reading: &Reading) -> String {
    let words = reading.words();
    let mut letters = words.chars();
    match letters.next() {
        Some(first) => first.to_uppercase().chain(letters).collect(),
        None => "Read the files by their format's conventions".to_owned(),
    }
}
