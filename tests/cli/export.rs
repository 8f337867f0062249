//! `relit export` and `relit demo`.

use crate::place::Place;
use crate::{done, refused, solve};

#[test]
fn results_are_exported() {
    let place = Place::new();
    done(&place.relit(&solve(&["--views", "none", "--out", "out"])));
    for (format, file) in [
        ("glb", "a.glb"),
        ("obj", "a.obj"),
        ("ply", "a.ply"),
        ("mitsuba", "a.xml"),
        ("csv", "a.csv"),
    ] {
        done(&place.relit(&["export", "out", "--format", format, "--out", file]));
        assert!(
            place.path(file).metadata().is_ok_and(|m| m.len() > 100),
            "{file}"
        );
    }
    refused(
        &place.relit(&["export", "out", "--format", "glb", "--out", "b.obj"]),
        2,
        &["b.obj", "--format glb", ".glb", "choose --format obj"],
    );
    assert!(!place.path("b.obj").exists());
    refused(
        &place.relit(&["export", "out", "--format", "probe", "--out", "p.exr"]),
        2,
        &["--at"],
    );
}

#[test]
fn the_built_in_room_is_written_with_its_truth() {
    let place = Place::new();
    done(&place.relit(&["demo", "--out", "demo"]));
    for name in [
        "transforms.json",
        "mesh.obj",
        "truth.json",
        "truth/albedo_000.exr",
    ] {
        assert!(place.path("demo").join(name).is_file(), "{name}");
    }
}
