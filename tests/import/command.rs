//! `relit import` from end to end: what it writes is a capture.

use crate::seven_scenes::{intrinsics, sample};
use crate::{cameras, check_room, write};
use relit::capture::read::{ReadOptions, read};
use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;

fn relit(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_relit"))
        .args(arguments)
        .output()
        .unwrap()
}

fn run(source: &Path, out: &Path, more: &[&str]) -> Output {
    let mut arguments = vec![
        "import",
        source.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
    ];
    arguments.extend(more);
    relit(&arguments)
}

#[test]
fn an_imported_scan_opens_as_a_capture() {
    let folder = TempDir::new().unwrap();
    let source = folder.path().join("scan");
    let cameras = cameras();
    sample(&source, &cameras);
    write(&source, "intrinsics.txt", intrinsics(&cameras[0]));
    let out = folder.path().join("deep/capture");
    let done = run(&source, &out, &["--voxel", "0.05", "--up", "0,1,0"]);
    assert!(done.status.success(), "{done:?}");
    let text = String::from_utf8(done.stdout).unwrap();
    assert!(
        text.contains("7-Scenes") && text.contains("photographs: 24"),
        "{text}"
    );

    let options = ReadOptions {
        segments: Some(1),
        ..ReadOptions::default()
    };
    let capture = read(&out, &options).unwrap();
    assert_eq!(capture.frames.len(), 24);
    assert_eq!(capture.up, glam::DVec3::Y);
    check_room(&capture.mesh, 0.05, |p| p);
    let frame = &capture.frames[5];
    assert_eq!(frame.load().unwrap().width, 80);
    // Depth goes along, in metres.
    let (path, unit) = frame.depth.clone().unwrap();
    let depth = image::open(path).unwrap().into_luma16();
    let metres = f64::from(depth.get_pixel(40, 30).0[0]) * unit;
    assert!((metres - cameras[5].hit(40, 30).0).abs() < 1e-3, "{metres}");
    // Nothing else is left beside it.
    let beside = std::fs::read_dir(folder.path().join("deep")).unwrap();
    assert_eq!(beside.count(), 1);
}

#[test]
fn what_is_there_is_not_overwritten_and_a_failure_leaves_nothing() {
    let folder = TempDir::new().unwrap();
    let source = folder.path().join("scan");
    let cameras = &cameras()[..3];
    sample(&source, cameras);
    let taken = folder.path().join("taken");
    write(&taken, "notes.txt", "mine");
    let refused = run(&source, &taken, &["--voxel", "0.1"]);
    assert_eq!(refused.status.code(), Some(1));
    let line = String::from_utf8(refused.stderr).unwrap();
    assert!(
        line.contains("not empty") && line.lines().count() == 1,
        "{line}"
    );
    assert_eq!(std::fs::read(taken.join("notes.txt")).unwrap(), b"mine");

    let path = source.join("seq-01/frame-000001.color.png");
    std::fs::write(path, "no image").unwrap();
    let out = folder.path().join("out");
    let failed = run(&source, &out, &["--voxel", "0.1"]);
    assert_eq!(failed.status.code(), Some(1));
    assert!(!out.exists());
    assert_eq!(
        run(&source, &out, &["--format", "unheard-of"])
            .status
            .code(),
        Some(2)
    );
}
