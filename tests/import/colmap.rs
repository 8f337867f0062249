//! COLMAP models, text and binary.

use crate::{Camera, cameras, check_cameras, import, import_with, project, says, write};
use glam::{DQuat, DVec2, DVec3};
use relit::capture::import::{ImportOptions, Model};
use std::path::Path;
use tempfile::TempDir;

const MESH: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

/// Parameters of a PINHOLE, its pixel centres at halves.
fn pinhole(c: &Camera) -> [f64; 4] {
    [c.fx, c.fy, c.cx + 0.5, c.cy + 0.5]
}

/// Quaternion (w first) and translation from world to camera.
fn to_camera(c: &Camera) -> ([f64; 4], DVec3) {
    let rotation = c.rotation.transpose();
    let q = DQuat::from_mat3(&rotation);
    ([q.w, q.x, q.y, q.z], -(rotation * c.center))
}

fn name(index: usize) -> String {
    format!("left room/photo {index:02}.png")
}

fn text(folder: &Path, cameras: &[Camera], model: &str, parameters: &[f64]) {
    let list = |numbers: &[f64]| {
        let words: Vec<String> = numbers.iter().map(f64::to_string).collect();
        words.join(" ")
    };
    let camera = format!("# Camera list\n7 {model} 80 60 {}\n", list(parameters));
    write(folder, "sparse/0/cameras.txt", camera);
    let mut images = "# Image list with two lines of data per image:\n".to_owned();
    for (index, camera) in cameras.iter().enumerate() {
        let (q, t) = to_camera(camera);
        let (q, t) = (list(&q), list(&t.to_array()));
        // Every other image has no points: its second line is empty.
        let points = if index % 2 == 0 {
            "1.5 2.5 -1 3 4 17"
        } else {
            ""
        };
        images += &format!("{} {q} {t} 7 {}\n{points}\n", index + 1, name(index));
    }
    write(folder, "sparse/0/images.txt", images);
    photographs(folder, cameras);
}

fn binary(folder: &Path, cameras: &[Camera]) -> (Vec<u8>, Vec<u8>) {
    let mut file = 1_u64.to_le_bytes().to_vec();
    file.extend(7_u32.to_le_bytes());
    file.extend(1_i32.to_le_bytes());
    file.extend(80_u64.to_le_bytes());
    file.extend(60_u64.to_le_bytes());
    file.extend(pinhole(&cameras[0]).iter().flat_map(|x| x.to_le_bytes()));
    write(folder, "sparse/0/cameras.bin", &file);
    let mut images = (cameras.len() as u64).to_le_bytes().to_vec();
    for (index, camera) in cameras.iter().enumerate() {
        images.extend((index as u32 + 1).to_le_bytes());
        let (q, t) = to_camera(camera);
        images.extend(q.iter().chain(&t.to_array()).flat_map(|x| x.to_le_bytes()));
        images.extend(7_u32.to_le_bytes());
        images.extend(name(index).as_bytes());
        images.push(0);
        let points = index as u64 % 3;
        images.extend(points.to_le_bytes());
        images.extend(vec![1; 24 * points as usize]);
    }
    write(folder, "sparse/0/images.bin", &images);
    photographs(folder, cameras);
    (file, images)
}

fn photographs(folder: &Path, cameras: &[Camera]) {
    for (index, camera) in cameras.iter().enumerate() {
        let path = folder.join("images").join(name(index));
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        camera.photograph().save(path).unwrap();
    }
    write(folder, "meshed-poisson.ply", MESH);
    write(folder, "fused.ply", "points only");
}

#[test]
fn text_and_binary_models_give_the_cameras() {
    let cameras = &cameras()[..5];
    for is_binary in [false, true] {
        let folder = TempDir::new().unwrap();
        if is_binary {
            binary(folder.path(), cameras);
        } else {
            text(folder.path(), cameras, "PINHOLE", &pinhole(&cameras[0]));
        }
        let scan = import(folder.path()).unwrap();
        assert!(says(&scan, "COLMAP") && says(&scan, "5 images"));
        check_cameras(&scan, cameras, |p| p);
        assert_eq!(scan.mesh.triangles, [[0, 1, 2]]);
        assert!(says(&scan, "meshed-poisson.ply"));
    }
}

#[test]
fn distortion_of_a_captures_own_kind_is_kept() {
    let cameras = &cameras()[..1];
    let c = cameras[0];
    let (f, cx, cy) = (c.fx, c.cx + 0.5, c.cy + 0.5);
    for (model, parameters, distortion) in [
        ("SIMPLE_PINHOLE", vec![f, cx, cy], [0.0; 4]),
        ("SIMPLE_RADIAL", vec![f, cx, cy, 0.1], [0.1, 0.0, 0.0, 0.0]),
        (
            "RADIAL",
            vec![f, cx, cy, 0.1, -0.05],
            [0.1, -0.05, 0.0, 0.0],
        ),
        (
            "OPENCV",
            vec![f, f, cx, cy, 0.1, -0.05, 1e-3, 2e-3],
            [0.1, -0.05, 1e-3, 2e-3],
        ),
    ] {
        let folder = TempDir::new().unwrap();
        text(folder.path(), cameras, model, &parameters);
        let scan = import(folder.path()).unwrap();
        let frame = &scan.frames[0];
        assert!(frame.lens.fits_a_capture(), "{model}");
        assert_eq!(frame.lens.intrinsics().distortion, distortion, "{model}");
        // The distortion by its own formula, for a point off the axis.
        let p = DVec2::new(0.3, -0.2);
        let point = c.center + c.rotation * p.extend(1.0) * 2.0;
        let r2 = p.length_squared();
        let [k1, k2, p1, p2] = distortion;
        let radial = 1.0 + k1 * r2 + k2 * r2 * r2;
        let bent = DVec2::new(
            p.x * radial + 2.0 * p1 * p.x * p.y + p2 * (r2 + 2.0 * p.x * p.x),
            p.y * radial + p1 * (r2 + 2.0 * p.y * p.y) + 2.0 * p2 * p.x * p.y,
        );
        let expected = bent * f + DVec2::new(cx, cy);
        let seen = project(&frame.pose, &frame.lens.intrinsics(), point);
        assert!(
            (seen - expected).length() < 1e-6,
            "{model}: {seen} not {expected}"
        );
    }
}

#[test]
fn fisheyes_are_resampled_so_that_points_land_where_the_pinhole_says() {
    let c = cameras()[0];
    let folder = TempDir::new().unwrap();
    let parameters = [c.fx, c.fx, c.cx + 0.5, c.cy + 0.5, 0.05, 0.01, 0.0, 0.0];
    text(folder.path(), &[c], "OPENCV_FISHEYE", &parameters);
    // A white dot where the lens images a known direction.
    let p = DVec2::new(0.35, -0.25);
    let angle = p.length().atan();
    let bent = angle * (1.0 + 0.05 * angle.powi(2) + 0.01 * angle.powi(4));
    let at = p / p.length() * bent * c.fx + DVec2::new(c.cx, c.cy) + 0.5;
    let dot = image::RgbImage::from_fn(80, 60, |x, y| {
        let d = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) - at;
        image::Rgb([if d.length() < 2.5 { 255 } else { 0 }; 3])
    });
    dot.save(folder.path().join("images").join(name(0)))
        .unwrap();
    let scan = import(folder.path()).unwrap();
    assert!(matches!(scan.frames[0].lens.model, Model::Fisheye(_)));
    assert!(says(&scan, "1 photographs are resampled"));

    let out = folder.path().join("capture");
    relit::export::import::write(&out, &scan).unwrap();
    let capture = relit::capture::read::read(&out, &Default::default()).unwrap();
    let photograph = capture.frames[0].load().unwrap();
    let expected = p * c.fx + DVec2::new(c.cx, c.cy) + 0.5;
    let (mut sum, mut weight) = (DVec2::ZERO, 0.0);
    for (i, color) in photograph.pixels.iter().enumerate() {
        let pixel = DVec2::new((i % 80) as f64 + 0.5, (i / 80) as f64 + 0.5);
        sum += pixel * f64::from(color.y);
        weight += f64::from(color.y);
    }
    let seen = sum / weight;
    assert!((seen - expected).length() < 0.15, "{seen} not {expected}");
}

#[test]
fn the_mesh_may_lie_anywhere_and_must_be_there() {
    let folder = TempDir::new().unwrap();
    let cameras = &cameras()[..2];
    binary(folder.path(), cameras);
    std::fs::remove_file(folder.path().join("meshed-poisson.ply")).unwrap();
    let error = import(folder.path()).unwrap_err();
    assert!(error.remedy.contains("--mesh"), "{error}");
    let elsewhere = TempDir::new().unwrap();
    write(elsewhere.path(), "room.ply", MESH);
    let options = ImportOptions {
        mesh: Some(elsewhere.path().join("room.ply")),
        ..ImportOptions::default()
    };
    let scan = import_with(folder.path(), &options).unwrap();
    check_cameras(&scan, cameras, |p| p);
}

#[test]
fn hostile_models_are_refused_by_name() {
    let folder = TempDir::new().unwrap();
    let cameras = &cameras()[..3];
    let (camera, images) = binary(folder.path(), cameras);
    let refused = |name: &str, bytes: &[u8]| {
        let good = std::fs::read(folder.path().join(name)).unwrap();
        write(folder.path(), name, bytes);
        let error = import(folder.path()).unwrap_err();
        assert!(error.to_string().contains(name), "{error}");
        write(folder.path(), name, good);
    };
    // Cut anywhere, and counts of 2⁶⁴ − 1.
    for length in (0..camera.len()).step_by(3) {
        refused("sparse/0/cameras.bin", &camera[..length]);
    }
    for length in (0..images.len()).step_by(7) {
        refused("sparse/0/images.bin", &images[..length]);
    }
    let huge = |bytes: &[u8], at: usize| {
        let mut bytes = bytes.to_vec();
        bytes[at..at + 8].fill(0xff);
        bytes
    };
    refused("sparse/0/cameras.bin", &huge(&camera, 0));
    refused("sparse/0/cameras.bin", &huge(&camera, 16));
    refused("sparse/0/images.bin", &huge(&images, 0));
    let mut not_a_number = images.clone();
    not_a_number[12..44].copy_from_slice(&f64::NAN.to_le_bytes().repeat(4));
    refused("sparse/0/images.bin", &not_a_number);
    let mut unknown = images.clone();
    unknown[68] = 9;
    refused("sparse/0/images.bin", &unknown);
    let mut outside = images;
    let at = outside.windows(4).position(|w| w == b"left").unwrap();
    outside[at..at + 9].copy_from_slice(b"../../../");
    refused("sparse/0/images.bin", &outside);
    for wrong in [
        "1 PINHOLE 80 60 1 2 3\n",
        "1 PINHOLE 80 60 nan 50 40 30\n",
        "1 PINHOLE 80 60 -50 50 40 30\n",
        "1 PINHOLE 0 60 50 50 40 30\n",
        "1 FOV 80 60 50 50 40 30 1\n",
        "1 NEW 80 60 50\n",
        "one\n",
    ] {
        let folder = TempDir::new().unwrap();
        text(folder.path(), cameras, "PINHOLE", &pinhole(&cameras[0]));
        write(folder.path(), "sparse/0/cameras.txt", wrong);
        let error = import(folder.path()).unwrap_err();
        assert!(error.place.contains("cameras.txt line 1"), "{error}");
    }
}
