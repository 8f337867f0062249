//! What is broken is refused with the file's name, by every reader, without a panic.

use crate::seven_scenes::{intrinsics, sample};
use crate::{cameras, import, import_with, write};
use relit::capture::import::ImportOptions;
use std::path::Path;
use tempfile::TempDir;

fn scan() -> TempDir {
    let folder = TempDir::new().unwrap();
    let cameras = &cameras()[..4];
    sample(folder.path(), cameras);
    write(folder.path(), "intrinsics.txt", intrinsics(&cameras[0]));
    folder
}

/// Imports after a file was changed; the error must name it.
fn refused(folder: &Path, name: &str, bytes: &[u8]) {
    let path = folder.join(name);
    let good = std::fs::read(&path).unwrap();
    std::fs::write(&path, bytes).unwrap();
    let error = import(folder).unwrap_err();
    assert!(error.to_string().contains(name), "{name}: {error}");
    std::fs::write(&path, good).unwrap();
}

#[test]
fn truncated_files_are_named() {
    let folder = scan();
    for name in [
        "seq-01/frame-000002.color.png",
        "seq-01/frame-000002.depth.png",
        "seq-01/frame-000002.pose.txt",
        "intrinsics.txt",
    ] {
        let good = std::fs::read(folder.path().join(name)).unwrap();
        for part in [0, good.len() / 3, good.len() / 2] {
            // Three of four rows of a pose are a pose.
            refused(folder.path(), name, &good[..part]);
        }
    }
    refused(folder.path(), "intrinsics.txt", b"0 0 40 0 0 30 0 0 1");
}

#[test]
fn missing_images_are_named() {
    for name in ["frame-000001.color.png", "frame-000001.depth.png"] {
        let folder = scan();
        std::fs::remove_file(folder.path().join("seq-01").join(name)).unwrap();
        let error = import(folder.path()).unwrap_err();
        assert!(error.place.contains(name), "{error}");
    }
}

#[test]
fn depth_of_eight_bits_and_headers_of_huge_images_are_refused() {
    let folder = scan();
    let name = "seq-01/frame-000001.depth.png";
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::GrayImage::new(80, 60)
        .write_to(&mut bytes, image::ImageFormat::Png)
        .unwrap();
    refused(folder.path(), name, bytes.get_ref());
    // A PNG whose header claims 2³¹ − 1 pixels a side; its check sum is right.
    let mut huge =
        b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\x7f\xff\xff\xff\x7f\xff\xff\xff\x10\0\0\0\0".to_vec();
    huge.extend(0x1f6f_9f3c_u32.to_be_bytes());
    refused(folder.path(), name, &huge);
    refused(folder.path(), "seq-01/frame-000000.depth.png", &huge);
    refused(folder.path(), "seq-01/frame-000000.color.png", &huge);
}

#[cfg(unix)]
#[test]
fn links_out_of_the_folder_are_refused() {
    let outer = TempDir::new().unwrap();
    let folder = scan();
    let name = "seq-01/frame-000001.color.png";
    let inside = folder.path().join(name);
    let outside = outer.path().join("secret.png");
    std::fs::rename(&inside, &outside).unwrap();
    std::os::unix::fs::symlink(&outside, &inside).unwrap();
    let error = import(folder.path()).unwrap_err();
    assert!(error.problem.contains("leaves"), "{error}");
    // A whole sequence that lies elsewhere.
    let linked = TempDir::new().unwrap();
    std::os::unix::fs::symlink(folder.path().join("seq-01"), linked.path().join("seq-01")).unwrap();
    let error = import(linked.path()).unwrap_err();
    assert!(
        error.place.contains("seq-01") && error.problem.contains("leads out"),
        "{error}"
    );
}

#[test]
fn empty_folders_depth_without_values_and_impossible_voxels_are_errors() {
    let folder = TempDir::new().unwrap();
    let error = import(folder.path()).unwrap_err();
    assert!(error.problem.contains("no known layout"), "{error}");
    assert!(import(&folder.path().join("none")).is_err());
    let folder = scan();
    let import_voxel = |edge: f64| {
        let options = ImportOptions {
            voxel: Some(edge),
            ..ImportOptions::default()
        };
        import_with(folder.path(), &options).unwrap_err()
    };
    for edge in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(import_voxel(edge).exit_code(), 2);
    }
    // Memory is bounded, whatever is asked for.
    let frames = import(folder.path()).unwrap().frames;
    let fused = relit::capture::fuse::fuse(&frames, 0.05, 1 << 20, &mut |_, _| {});
    let error = fused.unwrap_err();
    assert!(
        error.place == "--voxel" && error.problem.contains("memory"),
        "{error}"
    );
    for index in 0..4 {
        let path = folder
            .path()
            .join(format!("seq-01/frame-{index:06}.depth.png"));
        image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::new(80, 60)
            .save(path)
            .unwrap();
    }
    let error = import_with(folder.path(), &ImportOptions::default()).unwrap_err();
    assert!(error.problem.contains("no measured depth"), "{error}");
    let error = import(folder.path()).unwrap_err();
    assert!(error.problem.contains("no surface"), "{error}");
}
