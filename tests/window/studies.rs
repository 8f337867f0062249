//! The pane of the paper's experiments, driven by its labels.

use crate::connection::{Recorder, room, solving};
use crate::input::{click, retype};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use relit::app::layout::Pane;
use relit::app::window::Window;
use relit::session::command::Source;
use relit::session::snapshot::{OpenCapture, Phase};
use relit::study::experiments::STUDIES;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// The pane on the small room as a capture without truth, with the solve at rest.
fn shown(folder: &Path) -> (Harness<'static, Window>, Recorder) {
    let (mut harness, recorder) = solving(Harness::builder());
    let capture = OpenCapture {
        source: Source::Folder(folder.to_owned()),
        ..room()
    };
    recorder.show(|snapshot| {
        snapshot.capture = Some(Arc::new(capture));
        snapshot.phase = Phase::Paused;
    });
    harness.run_steps(3);
    harness.state_mut().app.bring_forward = Some(Pane::Studies);
    harness.run_steps(3);
    let out = folder.join("out");
    retype(&mut harness, "into", &out.to_string_lossy());
    click(&mut harness, "Quick");
    (harness, recorder)
}

/// Runs steps until something holds.
fn until(
    harness: &mut Harness<'_, Window>,
    what: &str,
    mut holds: impl FnMut(&Harness<'_, Window>) -> bool,
) {
    for _ in 0..3000 {
        harness.run_steps(1);
        if holds(harness) {
            return;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    panic!("{what} never came");
}

fn said(harness: &Harness<'_, Window>, part: &str) -> bool {
    let log = &harness.state().app.notices.log;
    log.iter().any(|event| event.message.contains(part))
}

#[test]
fn a_study_runs_on_the_open_capture_and_its_plot_grows() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut harness, _recorder) = shown(folder.path());
    harness.get_by_label("on the open capture, small room");
    click(&mut harness, "Start study");
    let points = |harness: &Harness<'_, Window>| {
        let shown = harness.state().app.studies.shown.as_ref();
        let plot = shown.and_then(|shown| shown.plot.as_ref());
        plot.map_or(0, |plot| plot.series.iter().map(|s| s.points.len()).sum())
    };
    let running = |harness: &Harness<'_, Window>| harness.state().app.studies.doing().is_some();
    until(&mut harness, "a first curve", |h| points(h) > 0);
    assert!(running(&harness), "the plot is live");
    let first = points(&harness);
    until(&mut harness, "its end", |h| !running(h));
    assert!(points(&harness) > first);
    assert!(said(&harness, "study batch written to"));
    harness.get_by_label_contains("transport cache ends at an error");
    for ending in ["csv", "png", "md"] {
        let file = folder.path().join(format!("out/small-room/batch.{ending}"));
        assert!(file.is_file(), "{}", file.display());
    }
}

#[test]
fn studies_on_rooms_of_their_own_say_so_wait_for_the_solve_and_can_be_cancelled() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut harness, recorder) = shown(folder.path());
    let running = |harness: &Harness<'_, Window>| harness.state().app.studies.doing().is_some();
    click(&mut harness, "Study");
    click(&mut harness, "sampling");
    click(&mut harness, "on rooms of its own");
    let question = STUDIES.iter().find(|study| study.name == "sampling");
    harness.get_by_label(question.expect("a study").question);

    recorder.show(|snapshot| snapshot.phase = Phase::Solving);
    harness.run_steps(2);
    click(&mut harness, "Start study");
    assert!(!running(&harness), "the solve runs");
    recorder.show(|snapshot| snapshot.phase = Phase::Paused);
    harness.run_steps(2);
    click(&mut harness, "Start study");
    assert!(running(&harness));
    let on = |harness: &Harness<'_, Window>| {
        let shown = harness.state().app.studies.shown.as_ref();
        shown.map(|shown| shown.on.clone())
    };
    assert_eq!(on(&harness).as_deref(), Some("rooms of its own"));
    click(&mut harness, "Cancel study");
    until(&mut harness, "its end", |h| !running(h));
    assert!(said(&harness, "study sampling was ended"));
    assert!(!folder.path().join("out").exists());

    // A solve that goes on ends it too.
    click(&mut harness, "Start study");
    recorder.show(|snapshot| snapshot.phase = Phase::Solving);
    until(&mut harness, "its end", |h| !running(h));
    harness.get_by_label("Start study");
}
