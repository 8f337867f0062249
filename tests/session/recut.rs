//! Segments that are cut anew where other pixels are kept out of the fits.

use crate::{ROOM, Rig, Stub, common, iterations};
use relit::calibrate::held_out::HoldOut;
use relit::capture::{Capture, Segmentation};
use relit::error::Error;
use relit::inverse::settings::Settings;
use relit::session::command::Command;
use relit::session::snapshot::{Level, Phase};
use std::sync::Arc;

/// The room without its objects, to be cut into as many.
fn whole() -> Capture {
    let mut capture = ROOM.clone();
    capture.mesh.object_of.fill(0);
    capture.mesh.objects.truncate(1);
    capture.segmentation = Some(Segmentation {
        file: "mesh.ply".into(),
        wanted: Some(common::truth().objects.len()),
    });
    capture
}

/// Settings that keep every second photograph out of the fits.
fn held_out() -> Settings {
    Settings {
        hold_out: 2,
        ..Settings::default()
    }
}

#[test]
fn a_new_start_cuts_the_mesh_again_only_where_other_pixels_are_held_out() {
    let rig = Rig::spawn(|_| Ok(whole()), Stub::NONE, true, None);
    let started = rig.until("some steps", |s| iterations(s) > 50);
    let first = started.capture.clone().expect("open");
    assert_eq!(first.options.hold_out, HoldOut::default());
    assert_eq!(
        first.capture.mesh.objects.len(),
        common::truth().objects.len()
    );

    // The same pixels: the same segments.
    assert!(rig.session.send(Command::Reset));
    let again = rig.until("a new start", |s| (1..50).contains(&iterations(s)));
    assert!(
        again
            .capture
            .as_ref()
            .is_some_and(|c| Arc::ptr_eq(c, &first))
    );

    let settings = held_out();
    assert!(rig.session.send(Command::Set(Box::new(settings.clone()))));
    assert!(rig.session.send(Command::Reset));
    let cut = rig.until("other segments", |s| {
        let open = s.capture.as_ref();
        s.phase == Phase::Solving && open.is_some_and(|c| !Arc::ptr_eq(c, &first))
    });
    let open = cut.capture.as_ref().expect("open");
    assert_eq!(open.options.hold_out, HoldOut::from(&settings));
    assert_eq!(open.hash, first.hash);
    rig.until("its solve", |s| {
        s.phase == Phase::Solving && iterations(s) > 3
    });
}

#[test]
fn a_capture_that_cannot_be_read_again_is_said_and_solved_with_the_segments_it_has() {
    let gone = || Error::new("mesh.ply", "No such file", "put it back");
    let rig = Rig::spawn(
        move |options| match options.hold_out.hold_out {
            0 => Ok(whole()),
            _ => Err(gone()),
        },
        Stub::NONE,
        true,
        None,
    );
    let started = rig.until("some steps", |s| iterations(s) > 50);
    let first = started.capture.clone().expect("open");
    assert!(rig.session.send(Command::Set(Box::new(held_out()))));
    assert!(rig.session.send(Command::Reset));
    let failed = rig.until("the error", |s| {
        s.events.iter().any(|e| e.level == Level::Error)
    });
    assert!(failed.events.iter().any(|e| e.message.contains("mesh.ply")));
    let again = rig.until("a new start", |s| {
        s.phase == Phase::Solving && (1..50).contains(&iterations(s))
    });
    assert!(
        again
            .capture
            .as_ref()
            .is_some_and(|c| Arc::ptr_eq(c, &first))
    );
}
