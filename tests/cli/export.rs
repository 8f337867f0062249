//! `relit export` and `relit demo`.

use crate::place::Place;
use crate::{done, refused, solve};
use relit::capture::read::{ReadOptions, read};
use relit::room::generated::Family;

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

#[test]
fn a_generated_room_is_written_as_it_was_generated() {
    let place = Place::new();
    let size = [32, 24];
    for (name, tolerance) in [("plain", 0.0), ("phone", 1e-4)] {
        let demo = ["demo", "--family", name, "--seed", "2", "--width", "32"];
        done(&place.relit(&[&demo[..], &["--out", name]].concat()));
        let family = Family::of_name(name).expect("a family");
        let room = family.generate(2, size).expect("a room");
        let read = read(&place.path(name), &ReadOptions::default()).expect("a capture");
        assert_eq!(read.mesh.objects, room.capture.mesh.objects);
        assert_eq!(read.frames.len(), room.capture.frames.len());
        for (written, generated) in read.frames.iter().zip(&room.capture.frames) {
            let [written, generated] =
                [written, generated].map(|f| f.load().expect("a photograph"));
            for (a, b) in written.pixels.iter().zip(&generated.pixels) {
                assert!(
                    (*a - *b).abs().max_element() <= tolerance,
                    "{name}: {a} {b}"
                );
            }
        }
        assert!(place.path(name).join("truth/albedo_000.exr").is_file());
    }
    let without_seed = ["demo", "--family", "plain", "--out", "other"];
    refused(&place.relit(&without_seed), 2, &["--seed"]);
}
