//! A capture that is read wrongly: the window says so and reads it rightly at a click.

use crate::connection::{Recorder, idle, room, solve};
use crate::input::click;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use relit::app::window::Window;
use relit::calibrate::alignment::{Alignment, Decision};
use relit::capture::reading::{Axes, Reading};
use relit::session::command::Command;
use relit::session::snapshot::{OpenCapture, Phase};
use std::sync::Arc;

/// A window on the small room, read as `before` and found to fit if read as `found` on top of that.
fn waiting(before: Reading, found: Reading) -> (Harness<'static, Window>, Recorder) {
    let (mut harness, recorder) = idle(Harness::builder());
    recorder.show(|snapshot| {
        solve(snapshot);
        let mut capture: OpenCapture = room();
        capture.options.reading = before;
        capture.alignment = Some(Alignment {
            agreement: 0.4,
            decision: Decision::Wrong {
                reading: found,
                agreement: 14.0,
            },
            mispaired: Vec::new(),
        });
        snapshot.phase = Phase::Paused;
        snapshot.progress = Arc::default();
        snapshot.capture = Some(Arc::new(capture));
    });
    harness.run_steps(4);
    recorder.sent();
    (harness, recorder)
}

const OPENCV: Reading = Reading {
    axes: Axes::OpenCv,
    mesh_turns: 0,
    mesh_scale: 1.0,
    focal: 1.0,
    lens_scale: 1.0,
    orientation: relit::capture::orientation::Orientation::turned(0),
    shift: 0,
};

#[test]
fn a_wrong_reading_is_mended_by_a_button_that_says_how() {
    let (mut harness, recorder) = waiting(Reading::default(), OPENCV);
    harness.get_by_label("The photographs do not fit the mesh");
    click(&mut harness, "Read the poses with OpenCV's axes");
    let sent = recorder.sent();
    let [Command::Reframe(options), Command::Run] = &sent[..] else {
        panic!("{sent:?}");
    };
    assert_eq!(options.reading, OPENCV);

    // The options were wrong, not the files.
    let (mut harness, recorder) = waiting(OPENCV, OPENCV);
    click(&mut harness, "Read the files by their format's conventions");
    assert!(matches!(&recorder.sent()[..],
        [Command::Reframe(options), Command::Run] if options.reading.is_default()));
}

#[test]
fn a_person_may_solve_as_it_is_and_is_not_asked_again() {
    let (mut harness, recorder) = waiting(Reading::default(), OPENCV);
    click(&mut harness, "Solve as it is");
    assert!(matches!(recorder.sent()[..], [Command::Run]));
    recorder.show(|snapshot| snapshot.phase = Phase::Solving);
    harness.run_steps(3);
    let title = "The photographs do not fit the mesh";
    assert!(harness.query_by_label(title).is_none());
}
