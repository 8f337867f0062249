//! 7-Scenes and 3DMatch.

use crate::{
    Camera, cameras, check_cameras, check_room, import, import_with, says, write, write_images,
};
use glam::DVec3;
use relit::capture::import::ImportOptions;
use std::path::Path;
use tempfile::TempDir;

/// What the names of a frame's files begin with.
fn stem(index: usize) -> String {
    format!("seq-{:02}/frame-{:06}", index / 12 + 1, index % 12)
}

/// The sample in a folder, in sequences of 12 frames.
pub fn sample(folder: &Path, cameras: &[Camera]) {
    for (index, camera) in cameras.iter().enumerate() {
        let stem = stem(index);
        let names = [format!("{stem}.color.png"), format!("{stem}.depth.png")];
        write_images(folder, camera, &names[0], &names[1], 1000.0);
        write(folder, &format!("{stem}.pose.txt"), camera.matrix_text());
    }
}

/// Intrinsics of the sample as 3DMatch writes them.
pub fn intrinsics(camera: &Camera) -> String {
    format!(
        "{} 0 {}\n0 {} {}\n0 0 1\n",
        camera.fx, camera.cx, camera.fy, camera.cy
    )
}

#[test]
fn the_room_comes_back() {
    let folder = TempDir::new().unwrap();
    let cameras = cameras();
    sample(folder.path(), &cameras);
    write(
        folder.path(),
        "camera-intrinsics.txt",
        intrinsics(&cameras[0]),
    );
    let scan = import(folder.path()).unwrap();
    assert!(says(&scan, "detected 7-Scenes") && says(&scan, "camera-intrinsics.txt"));
    check_cameras(&scan, &cameras, |p| p);
    check_room(&scan.mesh, 0.05, |p| p);
}

#[test]
fn depth_may_be_pgm() {
    let folder = TempDir::new().unwrap();
    let cameras = cameras();
    sample(folder.path(), &cameras);
    write(folder.path(), "intrinsics.txt", intrinsics(&cameras[0]));
    for index in 0..cameras.len() {
        let stem = stem(index);
        let png = folder.path().join(format!("{stem}.depth.png"));
        let depth = image::open(&png).unwrap().into_luma16();
        std::fs::remove_file(&png).unwrap();
        // Numbers of more than eight bits have the high byte first.
        let mut pgm = format!("P5\n{} {}\n65535\n", depth.width(), depth.height()).into_bytes();
        pgm.extend(depth.iter().flat_map(|v| v.to_be_bytes()));
        std::fs::write(folder.path().join(format!("{stem}.depth.pgm")), pgm).unwrap();
    }
    let scan = import(folder.path()).unwrap();
    check_room(&scan.mesh, 0.05, |p| p);
}

#[test]
fn the_data_sets_own_focal_length_is_taken_and_said() {
    let folder = TempDir::new().unwrap();
    let lens = [585.0 / 8.0, 585.0 / 8.0, 39.5, 29.5];
    let cameras: Vec<Camera> = cameras()
        .into_iter()
        .map(|camera| camera.with_lens([80, 60], lens))
        .collect();
    sample(folder.path(), &cameras);
    let scan = import(folder.path()).unwrap();
    assert!(says(&scan, "as 7-Scenes states"));
    check_cameras(&scan, &cameras, |p| p);
}

#[test]
fn depth_that_is_marked_invalid_and_frames_that_are_lost_play_no_part() {
    let folder = TempDir::new().unwrap();
    let cameras = cameras();
    sample(folder.path(), &cameras);
    write(folder.path(), "intrinsics.txt", intrinsics(&cameras[0]));
    let path = folder.path().join("seq-01/frame-000000.depth.png");
    let mut depth = image::open(&path).unwrap().into_luma16();
    for x in 0..40 {
        depth.put_pixel(x, 30, image::Luma([65535]));
    }
    depth.save(&path).unwrap();
    let lost = "nan nan nan nan\n".repeat(3) + "0 0 0 1\n";
    write(folder.path(), "seq-01/frame-000001.pose.txt", lost);
    let scan = import(folder.path()).unwrap();
    assert_eq!(scan.frames.len(), cameras.len() - 1);
    assert!(says(&scan, "1 frames left out"));
    check_room(&scan.mesh, 0.05, |p| p);
}

#[test]
fn frames_are_chosen_evenly_and_voxels_by_the_rooms_extent() {
    let folder = TempDir::new().unwrap();
    let cameras = cameras();
    sample(folder.path(), &cameras);
    write(folder.path(), "intrinsics.txt", intrinsics(&cameras[0]));
    let options = ImportOptions {
        max_frames: Some(5),
        every: 2,
        up: Some(DVec3::Y),
        ..ImportOptions::default()
    };
    let scan = import_with(folder.path(), &options).unwrap();
    assert_eq!(scan.frames.len(), 5);
    // Every other one of 24 is 12; five equal parts of these begin at 0, 3, 5, 8, 10.
    for (frame, index) in scan.frames.iter().zip([0, 6, 10, 16, 20]) {
        assert_eq!(frame.pose.center, cameras[index].center);
    }
    assert!(says(&scan, "photographs: 5 of 24"));
    // A pixel of these small images is larger than 1/256 of the room.
    assert!(says(&scan, "size of a depth pixel"), "{:?}", scan.remarks);
    assert_eq!(scan.up, Some(DVec3::Y));
}

#[test]
fn a_solve_takes_a_scan_and_then_its_results() {
    let place = TempDir::new().unwrap();
    let scan = place.path().join("attic");
    let cameras = cameras();
    sample(&scan, &cameras);
    write(&scan, "camera-intrinsics.txt", intrinsics(&cameras[0]));
    let relit = |words: &[&str]| {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_relit"))
            .args(words)
            .current_dir(place.path())
            .output()
            .expect("relit starts");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{said}");
        said
    };
    let quick = ["--preset", "preview", "--views", "none", "--trust-poses"];
    let scan = [&["solve", "attic"], &quick[..]].concat();
    assert!(relit(&scan).contains("imported into relit-out/attic/capture"));
    let written = |name: &str| place.path().join("relit-out/attic").join(name).exists();
    assert!(written("capture/transforms.json") && written("estimate.json"));
    assert!(relit(&scan).contains("imported into relit-out/attic/capture before"));
    let results = ["solve", "relit-out/attic", "--views", "none"];
    assert!(relit(&results).contains("going on from relit-out/attic"));
}
