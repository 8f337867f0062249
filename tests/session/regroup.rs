//! Objects joined and renamed while a solve runs.

use crate::{Rig, iterations, pinned};
use relit::capture::regroup::Regroup;
use relit::session::command::{Command, Regrouping};
use relit::session::snapshot::{Level, Phase, Snapshot};

#[test]
fn changed_objects_start_the_solve_over_and_are_saved_and_read_back() {
    let rig = Rig::resumable();
    let first = rig.until("some steps", |s| iterations(s) > 50);
    let names = |s: &Snapshot| -> Vec<String> {
        let objects = s.capture.iter().flat_map(|c| &c.scene.objects);
        objects.map(|o| o.name.clone()).collect()
    };
    let before = names(&first);
    let changes = vec![
        Regroup::Join {
            objects: before[..2].to_vec(),
        },
        Regroup::Rename {
            object: before[0].clone(),
            name: "all of the room".into(),
        },
    ];
    let hash = first.capture.as_ref().expect("open").hash.clone();
    let edits = pinned(0.3);
    let ask = |hash: &str, changes: &[Regroup]| {
        let wanted = Regrouping {
            hash: hash.to_owned(),
            changes: changes.to_vec(),
            edits: edits.clone(),
        };
        assert!(rig.session.send(Command::Regroup(Box::new(wanted))));
    };
    // Objects of another capture are none of this one's.
    ask("another", &changes);
    let ignored = rig.until("an answer", |s| s.regroupings == 1);
    assert_eq!(names(&ignored), before);
    ask(&hash, &changes);
    let changed = rig.until("other objects", |s| {
        s.phase == Phase::Solving && names(s).len() + 1 == before.len() && iterations(s) > 0
    });
    assert_eq!(names(&changed)[0], "all of the room");
    assert_eq!(names(&changed)[1..], before[2..]);
    assert_eq!((changed.regroupings, &changed.edits), (2, &edits));
    // The solver of these tests says what it was told by the roughness of the second object.
    rig.until("the pinned value", |s| {
        s.estimate.objects.get(1).and_then(|o| o.roughness) == Some(0.3)
    });

    // What cannot be done is said, and leaves what is open.
    let wrong = vec![Regroup::Join {
        objects: vec!["no such object".into()],
    }];
    ask(&hash, &wrong);
    rig.until("the error", |s| {
        s.events
            .iter()
            .any(|e| e.level == Level::Error && e.message.contains("no such object"))
    });
    let steps = iterations(&rig.session.latest());
    rig.until("solving on", |s| {
        s.phase == Phase::Solving && iterations(s) > steps + 3
    });

    let folder = tempfile::tempdir().expect("a temporary folder");
    assert!(rig.session.send(Command::Save(folder.path().to_owned())));
    rig.until("the save", |s| {
        s.events.iter().any(|e| e.message.starts_with("saved to"))
    });
    let saved = relit::session::save::load(folder.path()).expect("reads");
    assert_eq!(saved.options.objects, changes);
    let capture = changed.capture.as_ref().expect("open");
    let estimate = saved.estimate_for(capture).expect("the same capture");
    assert_eq!(estimate.objects.len(), before.len() - 1);
}
