//! transforms.json: cameras, exposures, up, and an error that names the field for everything else.

use crate::{folder, open, transforms};
use glam::DVec3;
use relit::capture::read::{ReadOptions, read};

#[test]
fn a_plain_file_gives_its_camera() {
    let folder = folder(&transforms(
        r#""exposure": 0.5, "k1": 0.1, "p2": 0.01, "unknown": [{}],"#,
    ));
    let capture = open(folder.path()).unwrap();
    let frame = &capture.frames[0];
    assert_eq!(frame.intrinsics.distortion, [0.1, 0.0, 0.0, 0.01]);
    assert_eq!((frame.intrinsics.fx, frame.intrinsics.cx), (3.0, 2.0));
    assert_eq!(frame.exposure, Some(0.5));
    assert_eq!(capture.up, DVec3::Y);
    // 128 of 255 through the sRGB curve, over the exposure.
    let value = frame.load().unwrap().pixels[0].x;
    assert!((value - 0.215_860_5 / 0.5).abs() < 1e-5, "{value}");
}

#[test]
fn focal_lengths_come_from_the_field_of_view_and_frames_overrule_the_file() {
    let text = r#"{"camera_angle_x": 1.5707963267948966, "up": [0, 0, 2], "frames": [
        {"file_path": "images/000.png", "fl_x": 7, "camera_model": "OPENCV", "transform_matrix":
            [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]},
        {"file_path": "images/000.png", "transform_matrix": [[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, 0]]}]}"#;
    let capture = open(folder(text).path()).unwrap();
    assert_eq!(capture.frames[0].intrinsics.fx, 7.0);
    assert!((capture.frames[1].intrinsics.fx - 2.0).abs() < 1e-12);
    assert_eq!(capture.frames[1].pose.center.x, 5.0);
    assert_eq!(capture.up, DVec3::Z);
    let guessed = |word: &str| capture.warnings.iter().any(|w| w.contains(word));
    assert!(guessed("fl_y") && guessed("cx"), "{:?}", capture.warnings);
}

#[test]
fn what_a_person_says_about_up_goes_before_the_file() {
    let folder = folder(&transforms(r#""up": [0, 0, 1],"#));
    let options = ReadOptions {
        up: Some(DVec3::X * 3.0),
        ..ReadOptions::default()
    };
    assert_eq!(read(folder.path(), &options).unwrap().up, DVec3::X);
}

#[test]
fn every_flaw_is_an_error_that_names_the_field() {
    let good = transforms("");
    for (from, to, place, problem) in [
        ("PINHOLE", "OPENCV_FISHEYE", "camera_model", "not supported"),
        (
            r#""cx": 2,"#,
            r#""cx": 2, "is_fisheye": true,"#,
            "is_fisheye",
            "no fisheye",
        ),
        (
            r#""cx": 2,"#,
            r#""cx": 2, "k3": 0.1,"#,
            "k3",
            "not supported",
        ),
        (r#""w": 4"#, r#""w": 8"#, ": w", "images/000.png is 4×2"),
        (r#""w": 4"#, r#""w": -4"#, ": w", "whole"),
        (r#""fl_x": 3"#, r#""fl_x": 0"#, "fl_x", "impossible"),
        (r#""fl_x": 3"#, r#""fl_x": "3""#, "fl_x", "number"),
        (r#""fl_x": 3, "#, "", "frames[0].fl_x", "neither"),
        (
            "[0, 1, 0, 0]",
            "[0, 0, 0, 0]",
            "frames[0].transform_matrix",
            "singular",
        ),
        (
            "[0, 1, 0, 0]",
            "[0.5, 1, 0, 0]",
            "frames[0].transform_matrix",
            "rigid",
        ),
        (
            "[0, 1, 0, 0]",
            "[0, -1, 0, 0]",
            "frames[0].transform_matrix",
            "mirrors",
        ),
        (
            "[0, 1, 0, 0]",
            "[0, 1, 0]",
            "frames[0].transform_matrix",
            "matrix",
        ),
        (
            "[0, 1, 0, 0]",
            "[0, true, 0, 0]",
            "frames[0].transform_matrix",
            "matrix",
        ),
        (
            "transform_matrix",
            "matrix",
            "frames[0].transform_matrix",
            "absent",
        ),
        ("file_path", "path", "frames[0].file_path", "absent"),
        (
            "images/000.png",
            "images/001.png",
            "frames[0].file_path",
            "001.png",
        ),
        (
            "images/000.png",
            "../../etc/passwd",
            "frames[0].file_path",
            "leaves",
        ),
        (
            "images/000.png",
            "/etc/passwd",
            "frames[0].file_path",
            "leaves",
        ),
        ("images/000.png", "mesh.obj", "mesh.obj", "EXR"),
        (
            r#""frames": ["#,
            r#""frames": [], "x": ["#,
            "frames",
            "empty",
        ),
        (r#""frames": ["#, r#""frames": 3, "x": ["#, "frames", "list"),
        (
            r#""frames": ["#,
            r#""frames": [4], "x": ["#,
            "frames[0]",
            "object",
        ),
        (
            r#""frames""#,
            r#""exposure": 0, "frames""#,
            "exposure",
            "impossible",
        ),
        (r#""frames""#, r#""up": [0, 0, 0], "frames""#, "up", "zero"),
        (r#""frames""#, r#""up": [0, 0], "frames""#, "up", "three"),
        (
            r#""frames""#,
            r#""mesh_path": "../mesh.obj", "frames""#,
            "mesh_path",
            "leaves",
        ),
        (
            r#""frames""#,
            r#""mesh_path": "images", "frames""#,
            "mesh_path",
            "regular",
        ),
        (
            r#""frames""#,
            r#""mesh_path": "images/000.png", "frames""#,
            "000.png",
            "OBJ",
        ),
        (
            r#"{"camera_model""#,
            r#"{"camera_model"#,
            "transforms.json",
            "JSON",
        ),
        (r#""cx": 2"#, r#""cx": 1e999"#, "transforms.json", "JSON"),
        (r#""cx": 2"#, r#""cx": NaN"#, "transforms.json", "JSON"),
    ] {
        assert!(good.contains(from), "{from}");
        let error = open(folder(&good.replacen(from, to, 1)).path()).unwrap_err();
        assert!(error.place.contains(place), "{to}: {error}");
        assert!(error.problem.contains(problem), "{to}: {error}");
        assert!(!error.remedy.is_empty() && !error.to_string().contains('\n'));
    }
}

#[test]
fn missing_pieces_are_named() {
    let folder = folder(&transforms(""));
    std::fs::remove_file(folder.path().join("mesh.obj")).unwrap();
    let error = open(folder.path()).unwrap_err();
    assert!(error.place.contains("mesh_path") && error.problem.contains("mesh.obj"));
    std::fs::remove_file(folder.path().join("transforms.json")).unwrap();
    assert!(
        open(folder.path())
            .unwrap_err()
            .place
            .contains("transforms.json")
    );
    assert!(
        open(&folder.path().join("none"))
            .unwrap_err()
            .place
            .contains("none")
    );
}

#[test]
fn json_nested_a_million_deep_is_an_error() {
    let deep = "[".repeat(1_000_000);
    let error = open(folder(&transforms(&format!(r#""x": {deep}"#))).path()).unwrap_err();
    assert!(error.problem.contains("recursion"), "{error}");
}
