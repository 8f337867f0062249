//! TUM RGB-D.

use crate::{
    Camera, cameras, check_cameras, check_room, import, import_with, many_cameras, says, write,
    write_images,
};
use relit::capture::import::{ImportOptions, Model};
use std::path::Path;
use tempfile::TempDir;

/// The ROS default at an eighth of its size.
const LENS: [f64; 4] = [65.625, 65.625, 39.5, 29.5];

/// Photographs at whole thirtieths of a second, depth 7 ms later, poses every 10 ms 3 ms off.
fn sample(folder: &Path, cameras: &[Camera]) {
    let mut texts = [
        "# color images\n# timestamp filename\n".to_owned(),
        "# depth maps\n".to_owned(),
        "# ground truth trajectory\n# timestamp tx ty tz qx qy qz qw\n".to_owned(),
    ];
    for (index, camera) in cameras.iter().enumerate() {
        let time = 1_305_031_102.175_3 + index as f64 * 0.5;
        let names = [
            format!("rgb/{time:.6}.png"),
            format!("depth/{:.6}.png", time + 0.007),
        ];
        write_images(folder, camera, &names[0], &names[1], 5000.0);
        texts[0] += &format!("{time:.6} {}\n", names[0]);
        texts[1] += &format!("{:.6} {}\n", time + 0.007, names[1]);
        for step in [-1.0, 0.0, 1.0] {
            let moved = Camera {
                center: camera.center + glam::DVec3::splat(step),
                ..*camera
            };
            let stamp = time + 0.003 + step * 0.01;
            texts[2] += &format!("{stamp:.4} {}\n", moved.trajectory_text());
        }
    }
    // A photograph without a pose.
    write_images(
        folder,
        &cameras[0],
        "rgb/late.png",
        "depth/late.png",
        5000.0,
    );
    texts[0] += "1405031102.0 rgb/late.png\n";
    texts[1] += "1405031102.0 depth/late.png\n";
    for (name, text) in ["rgb.txt", "depth.txt", "groundtruth.txt"]
        .iter()
        .zip(texts)
    {
        write(folder, name, text);
    }
}

fn small() -> Vec<Camera> {
    many_cameras()
        .into_iter()
        .map(|camera| camera.with_lens([80, 60], LENS))
        .collect()
}

#[test]
fn images_and_poses_find_each_other_by_time_and_the_room_comes_back() {
    let folder = TempDir::new().unwrap();
    let cameras = small();
    sample(folder.path(), &cameras);
    let scan = import(folder.path()).unwrap();
    assert!(says(&scan, "TUM RGB-D") && says(&scan, "ROS default"));
    assert!(
        says(&scan, "1 photographs left out: no pose"),
        "{:?}",
        scan.remarks
    );
    check_cameras(&scan, &cameras, |p| p);
    check_room(&scan.mesh, 0.05, |p| p);
}

#[test]
fn the_folders_name_tells_the_calibration() {
    let outer = TempDir::new().unwrap();
    let folder = outer.path().join("rgbd_dataset_freiburg1_desk");
    sample(&folder, &small()[..2]);
    let scan = import(&folder).unwrap();
    let lens = scan.frames[0].lens;
    assert!((lens.pinhole.fx - 517.3 / 8.0).abs() < 1e-9);
    assert!(matches!(lens.model, Model::Rational { k, .. } if k[2] == 1.1633));
    assert!(!lens.fits_a_capture());
}

#[test]
fn intrinsics_of_the_person_go_first() {
    let folder = TempDir::new().unwrap();
    let cameras = cameras();
    sample(folder.path(), &cameras);
    let c = cameras[0];
    let options = ImportOptions {
        voxel: Some(0.05),
        intrinsics: Some([c.fx, c.fy, c.cx, c.cy]),
        ..ImportOptions::default()
    };
    let scan = import_with(folder.path(), &options).unwrap();
    check_cameras(&scan, &cameras, |p| p);
    check_room(&scan.mesh, 0.05, |p| p);
}

#[test]
fn broken_lines_are_named() {
    let folder = TempDir::new().unwrap();
    sample(folder.path(), &small()[..2]);
    for (name, text, words) in [
        ("rgb.txt", "# x\nnow rgb/1.png\n", "rgb.txt line 2"),
        ("rgb.txt", "1.0\n", "rgb.txt line 1"),
        ("groundtruth.txt", "1.0 2 3\n", "groundtruth.txt line 1"),
        (
            "groundtruth.txt",
            "1305031102.1753 0 0 0 0 0 0 0\n",
            "groundtruth.txt timestamp",
        ),
    ] {
        let good = std::fs::read(folder.path().join(name)).unwrap();
        write(folder.path(), name, text);
        let error = import(folder.path()).unwrap_err();
        assert!(error.to_string().contains(words), "{error}");
        write(folder.path(), name, good);
    }
}
