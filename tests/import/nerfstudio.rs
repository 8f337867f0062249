//! transforms.json with what other programs than relit write into it.

use crate::{
    Camera, cameras, check_cameras, check_room, import, import_with, project, says, write,
    write_images,
};
use glam::{DMat3, DMat4, DVec2, DVec3};
use relit::capture::import::{AppliedTransform, ImportOptions, Model};
use serde_json::{Value, json};
use std::path::Path;
use tempfile::TempDir;

const OBJ: &str = "o a\nv 0 0 1\nv 1 0 1\nv 0 1 1\nf 1 2 3\n";

/// Rows of the camera-to-world matrix with OpenGL's camera axes.
fn matrix(camera: &Camera) -> Vec<[f64; 4]> {
    let rows = camera.matrix();
    rows.map(|[a, b, c, d]| [a, -b, -c, d])[..3]
        .iter()
        .copied()
        .chain([[0.0, 0.0, 0.0, 1.0]])
        .collect()
}

fn file(cameras: &[Camera], model: &str) -> Value {
    let c = cameras[0];
    let frames: Vec<Value> = (cameras.iter().enumerate())
        .map(|(i, camera)| {
            json!({"file_path": format!("./images/{i:03}.png"), "transform_matrix": matrix(camera)})
        })
        .collect();
    json!({"camera_model": model, "w": 80, "h": 60, "fl_x": c.fx, "fl_y": c.fy,
        "cx": c.cx + 0.5, "cy": c.cy + 0.5, "frames": frames})
}

fn sample(folder: &Path, cameras: &[Camera], file: &Value) {
    for (index, camera) in cameras.iter().enumerate() {
        let names = [
            format!("images/{index:03}.png"),
            format!("depth/{index:03}.png"),
        ];
        write_images(folder, camera, &names[0], &names[1], 1000.0);
    }
    write(folder, "transforms.json", file.to_string());
}

#[test]
fn depth_is_fused_where_there_is_no_mesh() {
    let folder = TempDir::new().unwrap();
    let cameras = cameras();
    let mut transforms = file(&cameras, "OPENCV");
    for (i, frame) in transforms["frames"]
        .as_array_mut()
        .unwrap()
        .iter_mut()
        .enumerate()
    {
        frame["depth_file_path"] = json!(format!("depth/{i:03}.png"));
    }
    sample(folder.path(), &cameras, &transforms);
    let scan = import(folder.path()).unwrap();
    check_cameras(&scan, &cameras, |p| p);
    check_room(&scan.mesh, 0.05, |p| p);
    for unit in [0.0, -0.001, 1e300] {
        transforms["depth_unit_scale_factor"] = json!(unit);
        write(folder.path(), "transforms.json", transforms.to_string());
        let error = import(folder.path()).unwrap_err();
        assert!(error.place.contains("depth/000.png"), "{error}");
    }
}

#[test]
fn an_applied_transform_is_undone_for_a_mesh_from_elsewhere() {
    let cameras = &cameras()[..3];
    let applied = DMat4::from_cols_array_2d(&[
        [0.0, 1.0, 0.0, 0.0],
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, -1.0, 0.0],
        [0.5, 0.0, 2.0, 1.0],
    ]);
    let linear = DMat3::from_mat4(applied);
    let moved: Vec<Camera> = cameras
        .iter()
        .map(|camera| Camera {
            rotation: linear * camera.rotation,
            center: applied.transform_point3(camera.center),
            ..*camera
        })
        .collect();
    let folder = TempDir::new().unwrap();
    let mut transforms = file(&moved, "PINHOLE");
    let rows = applied.transpose().to_cols_array_2d();
    transforms["applied_transform"] = json!(rows[..3]);
    sample(folder.path(), cameras, &transforms);
    write(folder.path(), "poly.obj", OBJ);
    let scan = import(folder.path()).unwrap();
    assert!(says(&scan, "applied_transform is undone"));
    check_cameras(&scan, cameras, |p| p);
    let keep = ImportOptions {
        applied_transform: AppliedTransform::Keep,
        ..ImportOptions::default()
    };
    let scan = import_with(folder.path(), &keep).unwrap();
    check_cameras(&scan, &moved, |p| p);
    // A mesh that the file names shares the poses' coordinates.
    transforms["mesh_path"] = json!("poly.obj");
    write(folder.path(), "transforms.json", transforms.to_string());
    let scan = import(folder.path()).unwrap();
    assert!(says(&scan, "applied_transform is kept"));
    check_cameras(&scan, &moved, |p| p);
}

#[test]
fn lenses_beyond_a_captures_own_are_understood() {
    let cameras = &cameras()[..1];
    let c = cameras[0];
    let point = c.center + c.rotation * DVec3::new(0.3, -0.2, 1.0);
    let p = DVec2::new(0.3, -0.2);
    let scan_of = |change: Value, model: &str| {
        let folder = TempDir::new().unwrap();
        let mut transforms = file(cameras, model);
        for (name, value) in change.as_object().unwrap() {
            transforms[name] = value.clone();
        }
        sample(folder.path(), cameras, &transforms);
        write(folder.path(), "mesh.obj", OBJ);
        import(folder.path())
    };
    // k1 k2 p1 p2 stay.
    let scan = scan_of(
        json!({"k1": 0.1, "k2": -0.02, "p1": 1e-3, "p2": 2e-3, "k3": 0.0}),
        "OPENCV",
    );
    let lens = scan.unwrap().frames[0].lens;
    assert_eq!(lens.intrinsics().distortion, [0.1, -0.02, 1e-3, 2e-3]);
    // k3 needs resampling.
    let scan = scan_of(json!({"k1": 0.1, "k3": 0.05}), "OPENCV").unwrap();
    let lens = scan.frames[0].lens;
    let r2 = p.length_squared();
    let expected = p * (1.0 + 0.1 * r2 + 0.05 * r2.powi(3));
    let seen = lens.project(DVec3::new(0.3, -0.2, 1.0)).unwrap();
    let expected = DVec2::new(expected.x * c.fx + c.cx, expected.y * c.fy + c.cy) + 0.5;
    assert!((seen - expected).length() < 1e-9);
    assert!(!lens.fits_a_capture());
    // Fisheyes, by model and by flag.
    for (change, model) in [
        (json!({"k1": 0.05}), "OPENCV_FISHEYE"),
        (json!({"k1": 0.05, "is_fisheye": true}), "OPENCV"),
    ] {
        let scan = scan_of(change, model).unwrap();
        assert_eq!(
            scan.frames[0].lens.model,
            Model::Fisheye([0.05, 0.0, 0.0, 0.0])
        );
    }
    // The photograph at half the camera's resolution.
    let double = json!({"w": 160, "h": 120, "fl_x": 2.0 * c.fx, "fl_y": 2.0 * c.fy,
        "cx": 2.0 * (c.cx + 0.5), "cy": 2.0 * (c.cy + 0.5)});
    let scan = scan_of(double, "PINHOLE").unwrap();
    let seen = project(
        &scan.frames[0].pose,
        &scan.frames[0].lens.intrinsics(),
        point,
    );
    assert!((seen - c.see(point).0 - 0.5).length() < 1e-9);
    for (change, model, words) in [
        (json!({"w": 160}), "PINHOLE", "another shape"),
        (json!({}), "EQUIRECTANGULAR", "not supported"),
        (json!({"k4": 0.1}), "OPENCV", "beyond k3"),
        (json!({"fl_x": 0}), "PINHOLE", "impossible"),
        (json!({"k1": "x"}), "OPENCV", "number"),
        (
            json!({"applied_transform": [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]}),
            "OPENCV",
            "singular",
        ),
        (json!({"applied_transform": [1]}), "OPENCV", "matrix"),
        (json!({"frames": 1}), "OPENCV", "not a list"),
        (json!({"frames": []}), "OPENCV", "no photograph"),
        (json!({"exposure": -1}), "OPENCV", "exposure"),
        (
            json!({"frames": [{"file_path": "../a.png"}]}),
            "OPENCV",
            "leaves",
        ),
    ] {
        let error = scan_of(change, model).unwrap_err();
        assert!(error.to_string().contains(words), "{error}");
    }
}

#[test]
fn intrinsics_and_masks_of_single_frames_count() {
    let folder = TempDir::new().unwrap();
    let first = cameras()[0];
    let second = cameras()[1].with_lens([60, 80], [70.0, 71.0, 30.0, 41.0]);
    let cameras = [first, second];
    let mut transforms = file(&cameras, "PINHOLE");
    let frame = &mut transforms["frames"][1];
    for (name, value) in [
        ("w", 60.0),
        ("h", 80.0),
        ("fl_x", 70.0),
        ("fl_y", 71.0),
        ("cx", 30.5),
        ("cy", 41.5),
    ] {
        frame[name] = json!(value);
    }
    frame["file_path"] = json!("images/001");
    transforms["frames"][0]["mask_path"] = json!("masks/0.png");
    sample(folder.path(), &cameras, &transforms);
    write(folder.path(), "mesh.obj", OBJ);
    write(folder.path(), "masks/0.png", []);
    // The left half may not be used; of the second photograph, by its alpha, the top.
    image::GrayImage::from_fn(80, 60, |x, _| image::Luma([if x < 40 { 0 } else { 255 }]))
        .save(folder.path().join("masks/0.png"))
        .unwrap();
    let mut alpha = image::DynamicImage::from(second.photograph()).into_rgba8();
    for (_, y, pixel) in alpha.enumerate_pixels_mut() {
        pixel.0[3] = if y < 40 { 0 } else { 255 };
    }
    alpha.save(folder.path().join("images/001.png")).unwrap();
    let scan = import(folder.path()).unwrap();
    check_cameras(&scan, &cameras, |p| p);
    let out = folder.path().join("capture");
    relit::export::import::write(&out, &scan).unwrap();
    let capture = relit::capture::read::read(&out, &Default::default()).unwrap();
    let photographs = [0, 1].map(|i| capture.frames[i].load().unwrap());
    for (i, usable) in photographs[0].usable.iter().enumerate() {
        assert_eq!(*usable, i % 80 >= 40);
    }
    for (i, usable) in photographs[1].usable.iter().enumerate() {
        assert_eq!(*usable, i / 60 >= 40);
    }
    // Masking changes no colour.
    let expected = relit::math::color::srgb_to_linear(
        f32::from(first.photograph().get_pixel(60, 30).0[0]) / 255.0,
    );
    assert!((photographs[0].pixels[30 * 80 + 60].x - expected).abs() < 1e-4);
}

#[test]
fn blenders_synthetic_sets_are_read() {
    let folder = TempDir::new().unwrap();
    let camera = cameras()[0].with_lens([80, 60], [50.0, 50.0, 39.5, 29.5]);
    let angle = 2.0 * (40.0_f64 / 50.0).atan();
    let transforms = json!({"camera_angle_x": angle,
        "frames": [{"file_path": "./train/r_0", "rotation": 0.01, "transform_matrix": matrix(&camera)}]});
    write(
        folder.path(),
        "transforms_train.json",
        transforms.to_string(),
    );
    write(folder.path(), "train/r_0.png", []);
    camera
        .photograph()
        .save(folder.path().join("train/r_0.png"))
        .unwrap();
    write(folder.path(), "room.obj", OBJ);
    let scan = import(folder.path()).unwrap();
    check_cameras(&scan, &[camera], |p| p);
    assert!(says(&scan, "other splits are left out"));
}
