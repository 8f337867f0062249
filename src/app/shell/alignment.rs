//! The question that is asked where photographs do not fit the mesh at their poses.

use crate::app::document::Document;
use crate::app::number::capitalized;
use crate::app::request::{Request, Requests};
use crate::session::command::Command;
use crate::session::snapshot::Phase;
use egui::{Align2, Context, Window};

/// What the button says that reads the capture without any option.
const AS_USUAL: &str = "Read the files by their format's conventions";

/// Says, until the solve has begun, that the capture is read wrongly, and offers the reading that fits.
pub fn show(ctx: &Context, document: &Document, requests: &mut Requests) {
    let snapshot = &document.snapshot;
    let waits = snapshot.phase == Phase::Paused && snapshot.progress.iterations == 0;
    let Some(capture) = document.capture().filter(|_| waits) else {
        return;
    };
    let alignment = capture.alignment.as_ref();
    let error = alignment.and_then(|a| a.error(&capture.name, &capture.options.reading));
    let Some((reading, error)) = capture.other_reading().zip(error) else {
        return;
    };
    Window::new("The photographs do not fit the mesh")
        .anchor(Align2::CENTER_CENTER, [0.0, 0.0])
        .collapsible(false)
        .resizable(false)
        .show(ctx, |ui| {
            ui.set_max_width(460.0);
            ui.label(&error.problem);
            ui.add_space(8.0);
            ui.horizontal_wrapped(|ui| {
                let reread = match reading.words() {
                    words if words.is_empty() => ui.button(AS_USUAL),
                    words => ui.button(capitalized(&words)),
                };
                let reread = reread.clicked();
                if reread {
                    let mut options = capture.options.clone();
                    options.reading = reading;
                    requests.ask(Request::Send(Command::Reframe(Box::new(options))));
                }
                if ui.button("Solve as it is").clicked() || reread {
                    requests.ask(Request::Send(Command::Run));
                }
            });
        });
}
