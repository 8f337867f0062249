//! ScanNet's exporter.

use crate::{Camera, cameras, check_cameras, check_vertices, import, says, write};
use std::path::Path;
use tempfile::TempDir;

/// fx, fy, cx, cy of the depth camera, at half the photograph's size.
const DEPTH: [f64; 4] = [25.0, 25.5, 19.35, 14.55];

fn sample(folder: &Path, cameras: &[Camera]) {
    let matrix =
        |[fx, fy, cx, cy]: [f64; 4]| format!("{fx} 0 {cx} 0\n0 {fy} {cy} 0\n0 0 1 0\n0 0 0 1\n");
    let c = cameras[0];
    write(
        folder,
        "intrinsic/intrinsic_color.txt",
        matrix([c.fx, c.fy, c.cx, c.cy]),
    );
    write(folder, "intrinsic/intrinsic_depth.txt", matrix(DEPTH));
    for (index, camera) in cameras.iter().enumerate() {
        for name in ["color", "depth"] {
            std::fs::create_dir_all(folder.join(name)).unwrap();
        }
        // ScanNet has JPEGs; those of plain walls are as exact as needed.
        let path = folder.join(format!("color/{index}.jpg"));
        camera.photograph().save(path).unwrap();
        let small = camera.with_lens([40, 30], DEPTH);
        let path = folder.join(format!("depth/{index}.png"));
        small.depth(1000.0).save(path).unwrap();
        write(folder, &format!("pose/{index}.txt"), camera.matrix_text());
    }
}

#[test]
fn the_room_comes_back_from_depth_of_another_size() {
    let folder = TempDir::new().unwrap();
    let cameras = cameras();
    sample(folder.path(), &cameras);
    let scan = import(folder.path()).unwrap();
    assert!(says(&scan, "ScanNet"));
    check_cameras(&scan, &cameras, |p| p);
    check_vertices(&scan.mesh, 0.05, |p| p);
}

#[test]
fn frames_without_a_pose_are_left_out_and_counted() {
    let folder = TempDir::new().unwrap();
    let cameras = cameras();
    sample(folder.path(), &cameras);
    for index in [3, 11] {
        let lost = "-inf -inf -inf -inf\n".repeat(4);
        write(folder.path(), &format!("pose/{index}.txt"), lost);
    }
    let scan = import(folder.path()).unwrap();
    assert!(says(&scan, "2 frames left out"));
    // Numbers order by value: the tenth comes after the ninth.
    let left: Vec<Camera> = (0..cameras.len())
        .filter(|i| ![3, 11].contains(i))
        .map(|i| cameras[i])
        .collect();
    check_cameras(&scan, &left, |p| p);
}

#[test]
fn the_scans_own_mesh_is_taken() {
    let folder = TempDir::new().unwrap();
    sample(folder.path(), &cameras());
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    write(folder.path(), "scene0000_00_vh_clean_2.ply", ply);
    let scan = import(folder.path()).unwrap();
    assert_eq!(scan.mesh.triangles, [[0, 1, 2]]);
    assert!(says(&scan, "vh_clean_2.ply, 1 triangles"));
}

#[test]
fn a_depth_image_of_one_frame_that_is_of_another_size_is_refused_by_name() {
    let folder = TempDir::new().unwrap();
    let cameras = cameras();
    sample(folder.path(), &cameras);
    let path = folder.path().join("depth/7.png");
    cameras[7].depth(1000.0).save(&path).unwrap();
    let error = import(folder.path()).unwrap_err();
    assert!(error.place.contains("depth/7.png"), "{error}");
}
