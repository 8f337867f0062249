//! Segments that are cut anew where other pixels are kept out of the fits.

use crate::{ROOM, Rig, common, iterations};
use relit::capture::Cut;
use relit::inverse::held_out::HoldOut;
use relit::inverse::settings::Settings;
use relit::session::command::Command;
use relit::session::snapshot::Phase;
use std::sync::Arc;

#[test]
fn a_new_start_cuts_the_mesh_again_only_where_other_pixels_are_held_out() {
    let mut capture = ROOM.clone();
    let count = common::truth().objects.len();
    capture.mesh.object_of.fill(0);
    capture.mesh.objects.truncate(1);
    capture.cut = Some(Cut {
        file: "mesh.ply".into(),
        wanted: Some(count),
    });
    let rig = Rig::spawn(capture, None, true);
    let started = rig.until("some steps", |s| iterations(s) > 50);
    let first = started.capture.clone().expect("open");
    assert_eq!(first.options.hold_out, HoldOut::default());
    assert_eq!(first.capture.mesh.objects.len(), count);

    // The same pixels: the same segments.
    assert!(rig.session.send(Command::Reset));
    let again = rig.until("a new start", |s| (1..50).contains(&iterations(s)));
    assert!(
        again
            .capture
            .as_ref()
            .is_some_and(|c| Arc::ptr_eq(c, &first))
    );

    let settings = Settings {
        hold_out: 2,
        ..Settings::default()
    };
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
