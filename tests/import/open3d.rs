//! Open3D's reconstruction system.

use crate::{Camera, cameras, check_cameras, check_room, import, says, write, write_images};
use glam::DMat4;
use std::path::Path;
use tempfile::TempDir;

fn images(folder: &Path, cameras: &[Camera]) {
    for (index, camera) in cameras.iter().enumerate() {
        let names = [
            format!("color/{index:05}.png"),
            format!("depth/{index:05}.png"),
        ];
        write_images(folder, camera, &names[0], &names[1], 1000.0);
    }
    let c = cameras[0];
    let intrinsics = format!(
        r#"{{"width": 80, "height": 60, "intrinsic_matrix": [{}, 0, 0, 0, {}, 0, {}, {}, 1]}}"#,
        c.fx, c.fy, c.cx, c.cy
    );
    write(folder, "camera_intrinsic.json", intrinsics);
}

fn log(cameras: &[Camera]) -> String {
    let stop =
        |(i, camera): (usize, &Camera)| format!("{i} {i} {}\n{}", i + 1, camera.matrix_text());
    cameras.iter().enumerate().map(stop).collect()
}

fn json(cameras: &[Camera]) -> String {
    let entry = |camera: &Camera| {
        let rows = DMat4::from_cols_array_2d(&camera.matrix()).transpose();
        let columns = rows.inverse().to_cols_array();
        serde_json::json!({"class_name": "PinholeCameraParameters", "extrinsic": columns})
    };
    let list: Vec<_> = cameras.iter().map(entry).collect();
    serde_json::json!({"class_name": "PinholeCameraTrajectory", "parameters": list}).to_string()
}

#[test]
fn the_room_comes_back_from_both_kinds_of_trajectory() {
    let cameras = cameras();
    for (name, text) in [
        ("scene/trajectory.log", log(&cameras)),
        ("office.log", log(&cameras)),
        ("trajectory.json", json(&cameras)),
    ] {
        let folder = TempDir::new().unwrap();
        images(folder.path(), &cameras);
        write(folder.path(), name, text);
        let scan = import(folder.path()).unwrap();
        assert!(says(&scan, "Open3D") && says(&scan, name));
        check_cameras(&scan, &cameras, |p| p);
        if name == "office.log" {
            check_room(&scan.mesh, 0.05, |p| p);
        }
    }
}

#[test]
fn broken_trajectories_and_intrinsics_are_refused_by_name() {
    let cameras = cameras();
    let folder = TempDir::new().unwrap();
    images(folder.path(), &cameras);
    let good = log(&cameras);
    let cut = &good[..good.len() / 2];
    for (text, words) in [
        (cut.to_owned(), "frame"),
        (good.replacen("0 0 1\n", "99 99 100\n", 1), "image 99"),
        (good.replacen("0 0 1\n", "-1 0 1\n", 1), "frame 0"),
        (good.replacen("0 0 1\n", "1e300 0 1\n", 1), "frame 0"),
    ] {
        write(folder.path(), "trajectory.log", &text);
        let error = import(folder.path()).unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains("trajectory.log") && text.contains(words),
            "{text}"
        );
    }
    write(folder.path(), "trajectory.log", good);
    for wrong in [
        "[]",
        r#"{"intrinsic_matrix": [1, 2]}"#,
        r#"{"width": 81, "intrinsic_matrix": [50, 0, 0, 0, 50, 0, 40, 30, 1]}"#,
        r#"{"intrinsic_matrix": [-50, 0, 0, 0, 50, 0, 40, 30, 1]}"#,
        "{",
    ] {
        write(folder.path(), "camera_intrinsic.json", wrong);
        let error = import(folder.path()).unwrap_err();
        assert!(error.place.contains("camera_intrinsic.json"), "{error}");
    }
}
