//! Objects joined, named anew and cut out, and taken back.

use crate::connection::{Recorder, solving};
use crate::input::{click, press, retype};
use egui::{Key, Modifiers, PointerButton, Pos2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use relit::app::window::Window;
use relit::capture::regroup::{Regroup, regroup};
use relit::scene::Scene;
use relit::session::command::Command;
use relit::session::edits::ObjectEdit;
use relit::session::snapshot::OpenCapture;
use std::sync::Arc;

/// The changes of objects that the window sent last.
fn sent(recorder: &Recorder) -> Option<Vec<Regroup>> {
    let sent = recorder.sent();
    sent.iter().rev().find_map(|command| match command {
        Command::Regroup(wanted) => Some(wanted.changes.clone()),
        _ => None,
    })
}

/// Answers as the worker does: the capture with objects changed.
fn answer(harness: &mut Harness<'_, Window>, recorder: &Recorder, changes: &[Regroup]) {
    let edits = harness.state().app.document.edits.clone();
    recorder.show(|snapshot| {
        let open = crate::connection::room();
        let mut capture = relit::capture::Capture::clone(&open.capture);
        regroup(&mut capture.mesh, changes).expect("changes of this mesh");
        let mut options = open.options.clone();
        options.objects = changes.to_vec();
        snapshot.view = None;
        snapshot.regroupings += 1;
        snapshot.edits = edits;
        snapshot.capture = Some(Arc::new(OpenCapture {
            options,
            scene: Arc::new(Scene::new(&capture).expect("a scene")),
            capture: Arc::new(capture),
            ..open
        }));
    });
    harness.run_steps(4);
}

fn add(harness: &mut Harness<'_, Window>, label: &str) {
    harness.event(egui::Event::ModifiersChanged(Modifiers::COMMAND));
    harness
        .get_by_label(label)
        .click_modifiers(Modifiers::COMMAND);
    harness.run_steps(3);
    harness.event(egui::Event::ModifiersChanged(Modifiers::NONE));
    harness.run_steps(1);
}

#[test]
fn chosen_objects_are_joined_and_come_apart_again_with_what_was_changed_of_them() {
    let (mut harness, recorder) = solving(Harness::builder());
    click(&mut harness, "Select wall");
    let recoloured = ObjectEdit {
        albedo: Some(glam::Vec3::splat(0.2)),
        ..ObjectEdit::default()
    };
    let off = ObjectEdit {
        off: true,
        ..ObjectEdit::default()
    };
    harness.state_mut().app.document.edits.set(1, recoloured);
    harness.state_mut().app.document.edits.set(2, off);
    harness.run_steps(3);
    add(&mut harness, "Select floor");
    assert_eq!(harness.state().app.view.selection.all(), [1, 0]);
    click(&mut harness, "Join objects");
    let joined = vec![Regroup::Join {
        objects: vec!["wall".into(), "floor".into()],
    }];
    assert_eq!(sent(&recorder), Some(joined.clone()));
    harness.get_by_label("Reading the mesh again…");
    // Until then nothing is changed or taken back that goes by an object's place.
    press(&mut harness, Modifiers::COMMAND, Key::Z);
    press(&mut harness, Modifiers::NONE, Key::K);
    assert_eq!(sent(&recorder), None);
    answer(&mut harness, &recorder, &joined);
    assert!(harness.query_by_label("Select floor").is_none());

    // The lamp has another place now, and is still off; of the wall that was, nothing is left.
    let app = &harness.state().app;
    assert_eq!(
        (app.document.edits.object(1), app.document.edits.object(0)),
        (off, ObjectEdit::default())
    );
    assert!(app.view.selection.object.is_none());

    press(&mut harness, Modifiers::COMMAND, Key::Z);
    assert_eq!(sent(&recorder), Some(Vec::new()));
    answer(&mut harness, &recorder, &[]);
    harness.get_by_label("Select floor");
    let app = &harness.state().app;
    assert_eq!(
        (app.document.edits.object(1), app.document.edits.object(2)),
        (recoloured, off)
    );
    press(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    assert_eq!(sent(&recorder), Some(joined));
}

#[test]
fn objects_that_cannot_be_read_again_stay_as_they_are() {
    let (mut harness, recorder) = solving(Harness::builder());
    click(&mut harness, "Select floor");
    add(&mut harness, "Select wall");
    click(&mut harness, "Join objects");
    assert!(sent(&recorder).is_some() && !harness.state().app.document.objects_are_current());
    recorder.show(|snapshot| snapshot.regroupings += 1);
    harness.run_steps(3);
    let app = &harness.state().app;
    assert!(app.document.objects_are_current() && app.document.regroups.is_empty());
}

#[test]
fn an_object_gets_the_name_that_is_typed_unless_another_has_it() {
    let (mut harness, recorder) = solving(Harness::builder());
    click(&mut harness, "Select floor");
    press(&mut harness, Modifiers::NONE, Key::F2);
    retype(&mut harness, "Name", "wall");
    press(&mut harness, Modifiers::NONE, Key::Enter);
    assert_eq!(sent(&recorder), None);

    press(&mut harness, Modifiers::NONE, Key::F2);
    retype(&mut harness, "Name", "carpet");
    press(&mut harness, Modifiers::NONE, Key::Enter);
    let named = vec![Regroup::Rename {
        object: "floor".into(),
        name: "carpet".into(),
    }];
    assert_eq!(sent(&recorder), Some(named.clone()));
    answer(&mut harness, &recorder, &named);
    harness.get_by_label("Select carpet");
}

#[test]
fn a_line_around_faces_cuts_them_out() {
    let (mut harness, recorder) = solving(Harness::builder());
    click(&mut harness, "Select floor");
    press(&mut harness, Modifiers::COMMAND | Modifiers::SHIFT, Key::X);
    harness.run_steps(3);
    harness.get_by_label("Draw around faces in the 3D view to cut them out");
    let rect = harness.get_by_label("3D view picture").rect().shrink(2.0);
    let button = |pressed, pos| egui::Event::PointerButton {
        pos,
        button: PointerButton::Primary,
        pressed,
        modifiers: Modifiers::NONE,
    };
    let corners: [Pos2; 4] = [
        rect.left_top(),
        rect.right_top(),
        rect.right_bottom(),
        rect.left_bottom(),
    ];
    harness.event(egui::Event::PointerMoved(corners[0]));
    harness.event(button(true, corners[0]));
    harness.run_steps(1);
    for at in &corners[1..] {
        harness.event(egui::Event::PointerMoved(*at));
        harness.run_steps(1);
    }
    harness.event(button(false, corners[3]));
    harness.run_steps(3);
    // Of the chosen object alone, all of which is seen.
    let cut = vec![Regroup::cut([0, 1], "cut 1".into())];
    assert_eq!(sent(&recorder), Some(cut));
    assert!(harness.state().app.view.tool.pick.is_none());
}
