//! Nothing is lost: what the window says of sessions, and how it takes them up.

use crate::connection::{solve, solving};
use crate::input::{click, press, type_into};
use egui::{Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use relit::inverse::solver::Termination;
use relit::session::command::Command;
use relit::session::snapshot::Phase;
use relit::session::store::{Kept, State};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::SystemTime;

fn kept(name: &str) -> Kept {
    Kept {
        folder: PathBuf::from("/sessions").join(name),
        name: format!("small room, {name}"),
        state: State::Finished(Termination::Converged),
        precious: true,
        saved: SystemTime::now(),
    }
}

#[test]
fn a_session_that_is_gone_on_with_is_said_and_can_be_started_over() {
    let (mut harness, recorder) = solving(Harness::builder());
    assert!(
        harness
            .query_by_label_contains("This goes on with")
            .is_none()
    );
    recorder.show(|snapshot| {
        solve(snapshot);
        snapshot.continued = Some("session 3".into());
        snapshot.frame = 2;
        snapshot.phase = Phase::Finished(Termination::Converged);
    });
    harness.run_steps(3);
    harness.get_by_label("This goes on with session 3, with its changes and objects.");
    harness.get_by_label("photograph 3 of 3");
    recorder.sent();
    click(&mut harness, "Start over");
    assert!(matches!(recorder.sent()[..], [Command::StartOver]));
    click(&mut harness, "Hide");
    assert!(
        harness
            .query_by_label_contains("This goes on with")
            .is_none()
    );
}

#[test]
fn sessions_are_listed_gone_on_with_and_removed_by_a_second_click_alone() {
    let (mut harness, recorder) = solving(Harness::builder());
    recorder.show(|snapshot| {
        snapshot.kept = Arc::new(vec![kept("session 2"), kept("session 1")]);
    });
    harness.run_steps(3);
    let open = |harness: &mut Harness<'_, _>| {
        press(harness, Modifiers::COMMAND, Key::P);
        type_into(harness, "Command", "sessions");
        press(harness, Modifiers::NONE, Key::Enter);
    };
    open(&mut harness);
    harness.get_by_label("Go on with small room, session 2");
    click(&mut harness, "Remove small room, session 2");
    assert!(recorder.sent().is_empty());
    click(&mut harness, "For good? small room, session 2");
    let folder = |name| PathBuf::from("/sessions").join(name);
    assert!(matches!(&recorder.sent()[..], [Command::Remove(f)] if *f == folder("session 2")));
    click(&mut harness, "Go on with small room, session 1");
    assert!(matches!(&recorder.sent()[..], [Command::Resume(f)] if *f == folder("session 1")));
}
