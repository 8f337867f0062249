//! Poses that are off are refined on photographs and depth images; sound ones stay.

use crate::{Camera, cameras, import_with, says, write, write_images};
use glam::{DMat3, DVec3};
use image::{Rgb, RgbImage};
use relit::capture::import::{Import, ImportOptions};
use relit::math::rng::{Stream, splitmix64};
use std::path::Path;
use tempfile::TempDir;

/// Width, height and focal length of the photographs in pixels.
const SIZE: [u32; 2] = [240, 180];
const FOCAL: f64 = 180.0;
/// Edge of the patches that walls are painted with, in metres.
const PATCH: f64 = 0.09;

/// The room's cameras with a larger picture.
fn large() -> Vec<Camera> {
    let lens = [FOCAL, FOCAL, 119.5, 89.5];
    (cameras().into_iter())
        .map(|camera| camera.with_lens(SIZE, lens))
        .collect()
}

/// The photograph of walls with painted patches, at an exposure of its own and with noise.
fn painted(camera: &Camera, index: usize) -> RgbImage {
    let mut stream = Stream::new(7, index as u64, 0, 0);
    let exposure = 0.6 + 0.4 * f64::from(stream.uniform());
    RgbImage::from_fn(SIZE[0], SIZE[1], |x, y| {
        // Four samples a pixel.
        let grey = [[-0.25, -0.25], [0.25, -0.25], [-0.25, 0.25], [0.25, 0.25]].map(|[u, v]| {
            let (point, wall) = camera.point(f64::from(x) + u, f64::from(y) + v);
            let cell = (point / PATCH).floor().as_ivec3();
            let mut key = wall as u64;
            for (axis, at) in cell.to_array().into_iter().enumerate() {
                if axis != wall / 2 {
                    key = splitmix64(key ^ at as u64);
                }
            }
            60.0 + (key % 128) as f64
        });
        let noise = 3.0 * f64::from(stream.normal());
        let value = exposure * grey.iter().sum::<f64>() / 4.0 + noise;
        Rgb([value.round() as u8; 3])
    })
}

/// A camera as a tracker with errors sees it.
fn mistaken(camera: &Camera, index: usize, position: f64, angle: f64) -> Camera {
    let mut stream = Stream::new(8, index as u64, 0, 0);
    let mut normal = || DVec3::from([(); 3].map(|()| f64::from(stream.normal())));
    let (turn, shift) = (normal() * angle, normal() * position);
    let axis = turn.try_normalize().unwrap_or(DVec3::X);
    Camera {
        rotation: DMat3::from_axis_angle(axis, turn.length()) * camera.rotation,
        center: camera.center + shift,
        ..*camera
    }
}

/// Imports the room with poses that are off by metres and radians.
fn scan(folder: &Path, position: f64, angle: f64, keep_poses: bool) -> Import {
    let cameras = large();
    for (index, camera) in cameras.iter().enumerate() {
        let stem = format!("seq-01/frame-{index:06}");
        let names = ["color", "depth"].map(|kind| format!("{stem}.{kind}.png"));
        write_images(folder, camera, &names[0], &names[1], 1000.0);
        painted(camera, index).save(folder.join(&names[0])).unwrap();
        let pose = mistaken(camera, index, position, angle).matrix_text();
        write(folder, &format!("{stem}.pose.txt"), pose);
    }
    write(
        folder,
        "camera-intrinsics.txt",
        super::seven_scenes::intrinsics(&cameras[0]),
    );
    let options = ImportOptions {
        keep_poses,
        ..ImportOptions::default()
    };
    import_with(folder, &options).expect("a scan")
}

/// Root mean square shift, in pixels, of points one metre in front of the cameras.
fn error(scan: &Import) -> f64 {
    let mut squares = Vec::new();
    for (frame, truth) in scan.frames.iter().zip(large()) {
        for (x, y) in [
            (-0.4, -0.3),
            (0.4, -0.3),
            (-0.4, 0.3),
            (0.4, 0.3),
            (0.0, 0.0),
        ] {
            let world = frame.pose.rotation * DVec3::new(x, y, -1.0) + frame.pose.center;
            let (pixel, _) = truth.see(world);
            let expected = glam::DVec2::new(x * FOCAL + truth.cx, -y * FOCAL + truth.cy);
            squares.push(pixel.distance_squared(expected));
        }
    }
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[test]
fn poses_that_are_off_are_refined_unless_they_are_to_be_kept() {
    let (position, angle) = (3e-3, 2e-3);
    let kept = scan(TempDir::new().unwrap().path(), position, angle, true);
    assert!(!says(&kept, "poses: refined"));
    let refined = scan(TempDir::new().unwrap().path(), position, angle, false);
    assert!(says(&refined, "poses: refined"), "{:?}", refined.remarks);
    let [before, after] = [&kept, &refined].map(error);
    assert!(before > 0.5, "{before}");
    // What is left is the mean error of all 24 cameras, a fifth of one's, and small errors of matches.
    assert!(after < 0.45 * before, "{before} pixels, then {after}");
}

#[test]
fn large_mistakes_are_refined_too() {
    let (position, angle) = (0.02, 0.01);
    let kept = scan(TempDir::new().unwrap().path(), position, angle, true);
    let refined = scan(TempDir::new().unwrap().path(), position, angle, false);
    let [before, after] = [&kept, &refined].map(error);
    assert!(before > 3.0, "{before}");
    assert!(after < 0.45 * before, "{before} pixels, then {after}");
}

#[test]
fn sound_poses_stay_as_they_are() {
    let folder = TempDir::new().unwrap();
    let scan = scan(folder.path(), 0.0, 0.0, false);
    assert!(!says(&scan, "poses: refined"), "{:?}", scan.remarks);
    assert!(error(&scan) < 1e-6);
}
