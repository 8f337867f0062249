//! Captures of which the meaning is clear although another program wrote them a little differently.

use crate::place::Place;
use crate::{change, done, heard, refused, solve};
use relit::capture::read::{ReadOptions, read};
use serde_json::json;
use std::fs;

fn objects(place: &Place) -> (Vec<String>, Vec<String>) {
    let capture = read(&place.path("room"), &ReadOptions::default());
    let capture = capture.unwrap_or_else(|error| panic!("{error}"));
    (capture.mesh.objects, capture.warnings)
}

#[test]
fn a_mark_before_the_text_backslashes_and_absolute_paths_into_the_folder_are_read() {
    let place = Place::new();
    let before = objects(&place);
    assert!(before.1.is_empty(), "{:?}", before.1);
    change(&place, "room", |file| {
        file["mesh_path"] = json!(place.path("room/mesh.obj"));
        file["frames"][0]["file_path"] = json!("images\\000.exr");
        file["frames"][1]["file_path"] = json!(place.path("room/images/001.exr"));
    });
    for name in ["transforms.json", "truth.json", "mesh.obj"] {
        let path = place.path("room").join(name);
        let marked = [b"\xef\xbb\xbf", &fs::read(&path).expect("reads")[..]].concat();
        fs::write(&path, marked).expect("writes");
    }
    assert_eq!(objects(&place), before);
    done(&place.relit(&solve("room", "out")));
    done(&place.relit(&["evaluate", "out", "--truth", "room"]));

    // Neither leads out of the folder.
    for path in [
        "..\\secret.exr",
        &place.path("secret.exr").display().to_string(),
    ] {
        fs::copy(place.path("room/images/000.exr"), place.path("secret.exr")).expect("copies");
        change(&place, "room", |file| {
            file["frames"][0]["file_path"] = json!(path)
        });
        let refusal = place.relit(&solve("room", "out"));
        refused(
            &refusal,
            1,
            &["frames[0].file_path", "leaves the capture's folder"],
        );
    }
}

#[test]
fn objects_of_one_name_are_one_object_and_it_is_said() {
    let place = Place::new();
    let mesh = place.path("room/mesh.obj");
    let text = fs::read_to_string(&mesh).expect("reads");
    fs::write(&mesh, text.replace("o ceiling", "o floor")).expect("writes");
    let (names, warnings) = objects(&place);
    assert_eq!(names.len(), 3);
    assert_eq!(warnings.len(), 1);
    assert!(
        warnings[0].contains("taken as one object each: floor"),
        "{warnings:?}"
    );
}

#[test]
fn control_characters_in_names_are_shown_and_not_obeyed() {
    let place = Place::new();
    let mesh = place.path("room/mesh.obj");
    let text = fs::read_to_string(&mesh).expect("reads");
    fs::write(&mesh, text.replace("o lamp", "o la\u{1b}[2Jmp")).expect("writes");
    let output = place.relit(&solve("room", "out"));
    done(&output);
    let table = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(table.contains(r"la\u{1b}[2Jmp"), "{table}");
    change(&place, "room", |file| {
        file["frames"][0]["file_path"] = json!("no\u{1b}]0;x\u{7}\nerror: such.exr");
    });
    let output = place.relit(&solve("room", "out"));
    refused(&output, 1, &[r"no\u{1b}]0;x\u{7}\nerror: such.exr"]);
    assert!(!heard(&output).contains('\u{1b}'));
}
