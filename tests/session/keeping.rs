//! A person's work is never lost: sessions are gone on with, and starting over leaves them as they are.

use crate::{Rig, iterations};
use relit::inverse::solver::Termination;
use relit::session::command::{Command, Placement, ViewCamera, ViewRequest};
use relit::session::edits::{Edits, ObjectEdit};
use relit::session::snapshot::Phase;
use relit::session::store::State;
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// A shown and a hidden object.
fn objects(folder: &Path) -> Vec<Placement> {
    let file = folder.join("block.obj");
    std::fs::write(&file, "v 0 0 0\nv 0.2 0 0\nv 0 0.2 0.2\nf 1 2 3\n").expect("written");
    let block = Placement {
        scale: 1.5,
        rotate: 30.0,
        ..Placement::new(file, Some(glam::DVec3::new(0.1, 0.0, -0.3)))
    };
    let hidden = Placement {
        hidden: true,
        ..block.clone()
    };
    vec![block, hidden]
}

/// A lamp switched off.
fn dark() -> Edits {
    let mut edits = Edits::default();
    let off = ObjectEdit {
        off: true,
        ..ObjectEdit::default()
    };
    edits.set(3, off);
    edits
}

#[test]
fn opening_goes_on_with_the_last_session_and_its_changes_objects_and_photograph() {
    let base = tempfile::tempdir().expect("a temporary folder");
    let sessions = base.path().join("sessions");
    let (edits, inserted) = (dark(), objects(base.path()));
    let rig = Rig::keeping(&sessions);
    rig.until("some steps", |s| iterations(s) > 50);
    assert!(rig.session.send(Command::View(ViewRequest {
        camera: ViewCamera::Frame(1),
        long_side: 16,
        composite: 16,
        render: true,
        layers: false,
    })));
    assert!(rig.session.send(Command::Edit(edits.clone())));
    assert!(rig.session.send(Command::Insert(inserted.clone())));
    rig.until("the edit", |s| s.edits == edits);
    assert!(rig.session.send(Command::Pause));
    let paused = rig.until("the pause", |s| s.phase == Phase::Paused);
    assert_eq!(paused.continued, None);
    // What came after the last save is saved at the worker's end.
    rig.session.join();

    let other = Rig::keeping(&sessions);
    let on = other.until("the session", |s| s.continued.is_some());
    assert_eq!(on.continued.as_deref(), Some("session 1"));
    assert_eq!((&on.edits, &*on.inserted, on.frame), (&edits, &inserted, 1));
    assert!(iterations(&on) >= iterations(&paused));
    // It was paused, and it is.
    other.until("the pause", |s| s.phase == Phase::Paused);
    assert!(other.session.send(Command::Run));
    other.until("going on", |s| iterations(s) > iterations(&on) + 20);
    // Started over, nothing of it is there but its entry in the list.
    assert!(other.session.send(Command::StartOver));
    let anew = other.until("a new session", |s| {
        s.continued.is_none() && iterations(s) > 3
    });
    assert!(anew.edits.is_empty() && anew.inserted.is_empty());
    other.session.join();

    let third = Rig::keeping(&sessions);
    let list = third.until("both", |s| s.kept.len() == 2 && s.continued.is_some());
    assert_eq!(list.continued.as_deref(), Some("session 2"));
    let first = list
        .kept
        .iter()
        .find(|kept| kept.name.ends_with("session 1"));
    let first = first.expect("the first session").folder.clone();
    assert!(first.join("thumbnail.png").exists());
    assert!(third.session.send(Command::Resume(first)));
    third.until("the first session", |s| {
        s.edits == edits && iterations(s) > iterations(&on) + 20
    });
}

#[test]
fn what_has_ended_is_shown_again_with_its_curve_and_not_solved_again() {
    let base = tempfile::tempdir().expect("a temporary folder");
    let rig = Rig::keeping(base.path());
    rig.until("some steps", |s| iterations(s) > 50);
    assert!(rig.session.send(Command::Finish));
    let end = Phase::Finished(Termination::Cancelled);
    let done = rig.until("the end", |s| s.phase == end);
    rig.session.join();

    let other = Rig::keeping(base.path());
    let shown = other.until("the session", |s| s.continued.is_some());
    assert_eq!(
        (&shown.phase, &shown.progress.losses),
        (&end, &done.progress.losses)
    );
    assert_eq!(shown.estimate.objects, done.estimate.objects);
    std::thread::sleep(Duration::from_millis(50));
    assert_eq!(other.steps.load(Ordering::SeqCst), 0);
    let state = shown.kept.first().map(|kept| kept.state);
    assert_eq!(state, Some(State::Finished(Termination::Cancelled)));

    // A reset leaves it as it is, too.
    assert!(other.session.send(Command::Reset));
    other.until("another solve", |s| iterations(s) > 3);
    other.session.join();
    let third = Rig::keeping(base.path());
    let list = third.until("both", |s| s.kept.len() == 2);
    let ended = list.kept.iter().filter(|kept| kept.precious);
    assert_eq!(ended.count(), 1);
}
