//! ICL-NUIM: left-handed cameras.

use crate::{
    Camera, check_cameras, check_room, import, import_with, many_cameras, says, write, write_images,
};
use glam::{DMat3, DVec3};
use relit::capture::import::ImportOptions;
use std::path::Path;
use tempfile::TempDir;

/// ICL-NUIM's lens at an eighth of its size: fy is negative.
const LENS: [f64; 4] = [481.2 / 8.0, -480.0 / 8.0, 39.5, 29.5];

/// Mirrors the world in z, as the import does.
fn mirrored(p: DVec3) -> DVec3 {
    DVec3::new(p.x, p.y, -p.z)
}

/// Cameras with axes right, up, forwards: with a rotation that is proper, and a left-handed world to go with it.
fn left_handed() -> Vec<Camera> {
    many_cameras()
        .into_iter()
        .map(|camera| {
            let r = camera.rotation;
            let rotation = DMat3::from_cols(-r.x_axis, -r.y_axis, r.z_axis);
            let camera = Camera { rotation, ..camera };
            camera.with_lens([80, 60], LENS)
        })
        .collect()
}

fn sample(folder: &Path, cameras: &[Camera]) {
    let (mut list, mut poses) = (String::new(), String::new());
    for (index, camera) in cameras.iter().enumerate() {
        let names = [format!("rgb/{index}.png"), format!("depth/{index}.png")];
        write_images(folder, camera, &names[0], &names[1], 5000.0);
        list += &format!("{index} {} {index} {}\n", names[1], names[0]);
        poses += &format!("{index} {}\n", camera.trajectory_text());
    }
    write(folder, "associations.txt", list);
    write(folder, "livingRoom0.gt.freiburg", poses);
}

#[test]
fn the_mirrored_room_comes_back() {
    let folder = TempDir::new().unwrap();
    let cameras = left_handed();
    assert!((cameras[0].rotation.determinant() - 1.0).abs() < 1e-9);
    sample(folder.path(), &cameras);
    let scan = import(folder.path()).unwrap();
    assert!(says(&scan, "ICL-NUIM") && says(&scan, "mirrored"));
    check_cameras(&scan, &cameras, mirrored);
    check_room(&scan.mesh, 0.05, mirrored);
    for frame in &scan.frames {
        assert!((frame.pose.rotation.determinant() - 1.0).abs() < 1e-9);
    }
    // Up stays up.
    let up: DVec3 = scan.frames.iter().map(|f| f.pose.rotation.y_axis).sum();
    assert!(up.normalize().y > 0.99, "{up}");
}

#[test]
fn lists_are_not_needed_and_a_mesh_is_mirrored_too() {
    let folder = TempDir::new().unwrap();
    sample(folder.path(), &left_handed());
    std::fs::remove_file(folder.path().join("associations.txt")).unwrap();
    let mesh = folder.path().join("room.obj");
    std::fs::write(&mesh, "o a\nv 0 0 1\nv 1 0 1\nv 0 1 1\nf 1 2 3\n").unwrap();
    let options = ImportOptions {
        mesh: Some(mesh),
        ..ImportOptions::default()
    };
    let scan = import_with(folder.path(), &options).unwrap();
    assert_eq!(scan.frames.len(), 70);
    assert_eq!(scan.mesh.positions[1], DVec3::new(1.0, 0.0, -1.0));
    assert_eq!(scan.mesh.triangles, [[0, 2, 1]]);
    assert!(scan.has_objects);
}
