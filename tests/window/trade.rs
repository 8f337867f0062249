//! The pane of the trade, driven by its labels.

use crate::connection::{Recorder, solving};
use crate::input::click;
use egui::Role;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use relit::app::layout::Pane;
use relit::app::trade::Vertical;
use relit::app::window::Window;
use relit::inverse::settings::{Preset, Settings};
use relit::inverse::solver::Termination;
use relit::session::command::Command;
use relit::session::snapshot::Phase;
use relit::study::trade::{Curve, Measure, Point, Trade};
use std::sync::Arc;
use std::time::Duration;

fn curve(preset: Preset, points: &[[f64; 3]]) -> Curve {
    let point = |&[seconds, error, claim]: &[f64; 3]| Point {
        seconds,
        error,
        spread: None,
        reported: (claim > 0.0).then_some(claim),
        rays: 1,
        iterations: 1,
        pareto: false,
    };
    Curve {
        name: preset.word().to_owned(),
        is_preset: true,
        settings: Settings {
            preset,
            ..Settings::default()
        },
        ended: Some(Termination::Converged),
        rejected: 0,
        points: points.iter().map(point).collect(),
    }
}

/// A trade of the small room as it could have been measured.
fn trade() -> Trade {
    let curves = vec![
        curve(Preset::Preview, &[[0.5, 0.02, 0.03]]),
        curve(
            Preset::Balanced,
            &[[1.5, 0.01, 0.018], [12.0, 0.003, 0.004]],
        ),
        curve(Preset::Paper, &[[2.0, 0.3, 0.0], [40.0, 0.05, 0.0]]),
    ];
    let seconds = Duration::from_secs(50);
    Trade::new(
        "small room",
        Some(String::new()),
        Measure::Albedo,
        seconds,
        curves,
    )
}

fn shown() -> (Harness<'static, Window>, Recorder) {
    let (mut harness, recorder) = solving(Harness::builder());
    harness.state_mut().app.view.layout.front = Some(Pane::Trade);
    harness.state_mut().app.jobs.measured.trade = Some(Arc::new(trade()));
    harness.run_steps(4);
    (harness, recorder)
}

fn set(recorder: &Recorder) -> Option<Settings> {
    let sent = recorder.sent();
    sent.iter().rev().find_map(|command| match command {
        Command::Set(settings) => Some(Settings::clone(settings)),
        _ => None,
    })
}

#[test]
fn an_offered_stop_sets_the_preset_that_is_quickest_there() {
    let (mut harness, recorder) = shown();
    click(&mut harness, "Stop at 1 %");
    let settings = set(&recorder).expect("sent");
    assert_eq!(settings.preset, Preset::Balanced);
    assert_eq!((settings.target_error, settings.time), (1.0, 0.0));
    click(&mut harness, "Stop at 5 %");
    let settings = set(&recorder).expect("sent");
    assert_eq!(settings.preset, Preset::Preview);
    assert_eq!(settings.target_error, 5.0);
    click(&mut harness, "Stop at 10 s");
    let settings = set(&recorder).expect("sent");
    assert_eq!(settings.preset, Preset::Balanced);
    assert_eq!((settings.target_error, settings.time), (0.0, 10.0));
    // Nothing reaches less, so nothing less is offered.
    assert!(harness.query_by_label("Stop at 0.2 %").is_none());
    assert!(harness.query_by_label("Stop at 60 s").is_none());
}

#[test]
fn a_click_on_a_point_of_the_curve_stops_there() {
    let (mut harness, recorder) = shown();
    for (vertical, expected) in [
        (Vertical::Claimed, (0.4, 0.0)),
        (Vertical::Measured, (0.0, 12.0)),
    ] {
        harness.state_mut().app.view.panels.trade.vertical = vertical;
        harness.run_steps(3);
        let places = harness.state().app.view.panels.trade.places.clone();
        let at = places.iter().find(|place| (place.1, place.2) == (1, 1));
        let at = at.expect("drawn").0;
        harness.hover_at(at);
        harness.run_steps(1);
        harness.drag_at(at);
        harness.run_steps(1);
        harness.drop_at(at);
        harness.run_steps(3);
        let settings = set(&recorder).expect("sent");
        assert_eq!(settings.preset, Preset::Balanced);
        assert_eq!((settings.target_error, settings.time), expected);
    }
}

#[test]
fn stops_are_typed_and_the_running_solve_draws_its_mark() {
    let (mut harness, recorder) = shown();
    for (label, text) in [("Stop at error", "0.25"), ("Stop at time", "7")] {
        let field = harness.get_by_role_and_label(Role::SpinButton, label);
        field.focus();
        harness.run_steps(2);
        harness
            .get_by_role_and_label(Role::SpinButton, label)
            .type_text(text);
        harness.run_steps(2);
        harness.key_press(egui::Key::Enter);
        harness.run_steps(3);
    }
    let settings = set(&recorder).expect("sent");
    assert_eq!((settings.target_error, settings.time), (0.25, 7.0));
    // A running solve has a mark from its first estimate on.
    recorder.show(|snapshot| {
        let mut progress = (*snapshot.progress).clone();
        progress.seconds_to_first_estimate = Some(1.0);
        snapshot.progress = Arc::new(progress);
    });
    for vertical in ["Measured error", "Claimed error"] {
        click(&mut harness, vertical);
    }
}

#[test]
fn it_is_measured_only_while_nothing_runs_and_can_be_cancelled() {
    let (mut harness, recorder) = shown();
    let doing = |harness: &Harness<'_, Window>| harness.state().app.jobs.measured.doing();
    click(&mut harness, "Measure");
    assert_eq!(doing(&harness), None, "the solve runs");

    recorder.show(|snapshot| snapshot.phase = Phase::Paused);
    harness.run_steps(2);
    click(&mut harness, "Measure");
    assert!(doing(&harness).is_some());
    click(&mut harness, "Cancel");
    ended(&mut harness);
    harness.get_by_label("Measure");

    // A solve that goes on ends the measurement too.
    click(&mut harness, "Measure");
    assert!(doing(&harness).is_some());
    recorder.show(|snapshot| snapshot.phase = Phase::Solving);
    ended(&mut harness);
}

/// Waits until nothing is measured.
fn ended(harness: &mut Harness<'_, Window>) {
    for _ in 0..1500 {
        harness.run_steps(1);
        if harness.state().app.jobs.measured.doing().is_none() {
            return;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    panic!("it goes on");
}

#[test]
fn the_trade_of_the_open_capture_is_read_and_that_of_another_is_not() {
    let (mut harness, _recorder) = shown();
    let folder = tempfile::tempdir().expect("a folder");
    let capture = harness
        .state()
        .app
        .document
        .capture()
        .expect("open")
        .clone();
    let view = &mut harness.state_mut().app.jobs.measured;
    view.trade = None;
    assert_eq!(view.load(folder.path(), &capture), Ok(()));
    assert!(view.trade.is_none());
    trade().write(folder.path()).expect("written");
    assert_eq!(view.load(folder.path(), &capture), Ok(()));
    assert_eq!(view.trade.as_deref(), Some(&trade()));
    let other = Trade {
        hash: Some("other".into()),
        ..trade()
    };
    other.write(folder.path()).expect("written");
    let message = view.load(folder.path(), &capture).expect_err("another's");
    assert!(message.contains("another capture"), "{message}");
}
