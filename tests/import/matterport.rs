//! Matterport3D houses, by the data set's description of its files.

use crate::{Camera, cameras, check_cameras, check_vertices, import, says, write};
use relit::capture::photograph::Encoding;
use relit::export::exr::{Precision, write_rgb};
use relit::math::picture::Picture;
use std::path::Path;
use tempfile::TempDir;

const UUID: &str = "0a1b2c";

/// Views named by camera and yaw, the same lens for all.
fn views(cameras: &[Camera]) -> impl Iterator<Item = (String, &Camera)> {
    (cameras.iter().enumerate()).map(|(i, camera)| (format!("{}_{}", i / 6, i % 6), camera))
}

fn original(folder: &Path, cameras: &[Camera], hdr: bool) {
    for (view, camera) in views(cameras) {
        let c = camera;
        write(
            folder,
            &format!("matterport_camera_poses/{UUID}_pose_{view}.txt"),
            camera.matrix_text(),
        );
        let lens = format!(
            "80 60 {} {} {} {} 0.1 -0.02 0.001 0.002 0\n",
            c.fx,
            c.fy,
            c.cx + 0.5,
            c.cy + 0.5
        );
        let index = &view[..1];
        write(
            folder,
            &format!("matterport_camera_intrinsics/{UUID}_intrinsics_{index}.txt"),
            lens,
        );
        let color = format!("matterport_color_images/{UUID}_i{view}.jpg");
        let depth = format!("matterport_depth_images/{UUID}_d{view}.png");
        crate::write_images(folder, camera, &color, &depth, 4000.0);
        write(
            folder,
            &format!("matterport_hdr_images/{UUID}_j{view}.jxr"),
            "II\u{1}",
        );
        if hdr {
            let picture = Picture::from_fn(80, 60, |x, _| glam::Vec3::splat(x as f32));
            let path = folder.join(format!("matterport_hdr_images/{UUID}_j{view}.exr"));
            write_rgb(&path, &picture, Precision::Half).unwrap();
        }
    }
    // A quad of two instances and one without.
    let ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
        property uchar red\nproperty uchar green\nproperty uchar blue\n\
        element face 3\nproperty list uchar int vertex_indices\nproperty int material_id\nproperty int segment_id\n\
        property int category_id\nend_header\n0 0 0 255 0 0\n1 0 0 255 0 0\n1 1 0 255 0 0\n0 1 0 255 0 0\n\
        3 0 1 2 7 12 3\n3 0 2 3 8 40 3\n3 0 1 3 9 -1 0\n";
    write(folder, "house_segmentations/house.ply", ply);
}

#[test]
fn hdr_photographs_lenses_poses_and_instances_come_together() {
    let folder = TempDir::new().unwrap();
    let cameras = &cameras()[..8];
    original(folder.path(), cameras, true);
    let scan = import(folder.path()).unwrap();
    assert!(says(&scan, "Matterport3D") && says(&scan, "HDR photographs: 8, tone-mapped: 0"));
    assert_eq!(scan.mesh.object_of, [1, 2, 0]);
    assert_eq!(scan.mesh.objects, ["object -1", "object 12", "object 40"]);
    assert!(scan.has_objects);
    let frame = &scan.frames[2];
    assert_eq!(
        frame.lens.intrinsics().distortion,
        [0.1, -0.02, 0.001, 0.002]
    );
    // Without its distortion, the frame's camera is the sample's.
    let mut plain = scan.clone();
    for frame in &mut plain.frames {
        frame.lens = relit::capture::import::Lens {
            model: relit::capture::import::Model::Brown([0.0; 4]),
            ..frame.lens
        };
    }
    check_cameras(&plain, cameras, |p| p);
    assert!((frame.depth.as_ref().unwrap().metres_per_unit - 0.000_25).abs() < 1e-12);
    // What is written keeps the radiance.
    let out = folder.path().join("capture");
    relit::export::import::write(&out, &scan).unwrap();
    let capture = relit::capture::read::read(&out, &Default::default()).unwrap();
    let photograph = capture.frames[0].load().unwrap();
    assert_eq!(photograph.encoding, Encoding::Linear);
    assert_eq!(photograph.pixels[60].x, 60.0);
    assert_eq!(
        capture.mesh.objects,
        ["object -1", "object 12", "object 40"]
    );
}

#[test]
fn tone_mapped_photographs_stand_in_and_it_is_said() {
    let folder = TempDir::new().unwrap();
    original(folder.path(), &cameras()[..2], false);
    let scan = import(folder.path()).unwrap();
    assert!(says(&scan, "2 JPEG XR images") && says(&scan, "tone-mapped: 2"));
    let gone = "matterport_color_images";
    std::fs::remove_dir_all(folder.path().join(gone)).unwrap();
    let error = import(folder.path()).unwrap_err();
    assert!(
        error.place.contains(gone) && error.remedy.contains("JPEG XR"),
        "{error}"
    );
}

#[test]
fn undistorted_images_have_their_origin_at_the_bottom() {
    let folder = TempDir::new().unwrap();
    let cameras = cameras();
    let c = cameras[0];
    let mut list = format!(
        "dataset matterport\nn_images {}\ndepth_directory undistorted_depth_images\n\
         color_directory undistorted_color_images\nintrinsics_matrix {} 0 {}  0 {} {} 0 0 1\n",
        cameras.len(),
        c.fx,
        c.cx + 0.5,
        c.fy,
        60.0 - (c.cy + 0.5)
    );
    for (view, camera) in views(&cameras) {
        let names = [format!("{UUID}_i{view}.png"), format!("{UUID}_d{view}.png")];
        crate::write_images(
            folder.path(),
            camera,
            &format!("undistorted_color_images/{}", names[0]),
            &format!("undistorted_depth_images/{}", names[1]),
            4000.0,
        );
        // OpenGL's camera axes.
        let rows = camera.matrix().map(|[a, b, c, d]| [a, -b, -c, d]);
        let rows = [rows[0], rows[1], rows[2], [0.0, 0.0, 0.0, 1.0]];
        let words: Vec<String> = rows.iter().flatten().map(f64::to_string).collect();
        list += &format!("scan {} {} {}\n", names[1], names[0], words.join(" "));
    }
    write(
        folder.path(),
        "undistorted_camera_parameters/house.conf",
        &list,
    );
    let scan = import(folder.path()).unwrap();
    check_cameras(&scan, &cameras, |p| p);
    check_vertices(&scan.mesh, 0.05, |p| p);
    for (from, to) in [
        ("scan ", "scan x y 1 "),
        ("intrinsics_matrix", "intrinsics_matrix x"),
        ("intrinsics_matrix", "other"),
    ] {
        write(
            folder.path(),
            "undistorted_camera_parameters/house.conf",
            list.replacen(from, to, 1),
        );
        let error = import(folder.path()).unwrap_err();
        assert!(error.place.contains("house.conf line"), "{error}");
    }
}

#[test]
fn broken_lenses_are_named() {
    let folder = TempDir::new().unwrap();
    original(folder.path(), &cameras()[..2], false);
    let name = format!("matterport_camera_intrinsics/{UUID}_intrinsics_0.txt");
    for wrong in [
        "",
        "80 60 50",
        "-80 60 50 50 40 30 0 0 0 0 0",
        "1e300 60 50 50 40 30 0 0 0 0 0",
        "80 60 0 50 40 30 0 0 0 0 0",
        "80 60 nan 50 40 30 0 0 0 0 0",
    ] {
        write(folder.path(), &name, wrong);
        let error = import(folder.path()).unwrap_err();
        assert!(error.place.contains(&name), "{error}");
    }
}
