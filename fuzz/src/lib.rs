//! What a fuzzer does with the bytes of a file: reads it as relit does, and uses what was read. Nothing may panic, hang or
//! take memory out of proportion. `tests/readers/corpus.rs` does the same with spoilt seeds on the stable toolchain.

use relit::calibrate::problem::Problem;
use relit::capture::import::{self, ImportOptions};
use relit::capture::read::{ReadOptions, read};
use relit::capture::truth::Truth;
use relit::compose::object::ObjectModel;
use relit::error::Result;
use relit::export;
use relit::inverse::estimate::Estimate;
use relit::inverse::solve;
use relit::inverse::solver::{Control, Observer, Progress};
use relit::session::command::{OpenOptions, Source};
use relit::session::open::open;
use relit::session::save;
use relit::session::snapshot::OpenCapture;
use relit::session::store;
use std::fs;
use std::io::Result as Io;
use std::path::Path;
use std::sync::OnceLock;
use tempfile::{TempDir, tempdir};

/// What reads the bytes of a file.
pub type Reader = fn(&[u8]);

/// The readers by name; `fuzz/seeds/NAME` holds its seeds.
pub const READERS: &[(&str, Reader)] = &[
    ("transforms", transforms),
    ("obj", obj),
    ("ply", ply),
    ("gltf", gltf),
    ("photograph", photograph),
    ("object_obj", object_obj),
    ("object_mtl", object_mtl),
    ("object_gltf", object_gltf),
    ("estimate", estimate),
    ("checkpoint", checkpoint),
    ("maps", maps),
    ("truth", truth),
    ("session", session),
    ("colmap_cameras", colmap_cameras),
    ("colmap_images", colmap_images),
    ("nerfstudio", nerfstudio),
    ("trajectory", trajectory),
];

const TRANSFORMS: &str = include_str!("../seeds/transforms/plain.json");
const MESH: &str = include_str!("../seeds/obj/triangle.obj");
const SCANNED: &[u8] = include_bytes!("../seeds/ply/ascii.ply");
const DEPTH: &[u8] = include_bytes!("../seeds/depth.png");
const PHOTOGRAPH: &[u8] = include_bytes!("../seeds/photograph/grey.png");

/// A sound capture in a folder of its own, but for one file.
///
/// # Errors
/// The disk fails.
pub fn capture_with(name: &str, bytes: &[u8]) -> Io<TempDir> {
    let folder = tempdir()?;
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("images"))?;
    fs::write(at("images/000.png"), PHOTOGRAPH)?;
    fs::write(at("mesh.obj"), MESH)?;
    fs::write(at("transforms.json"), TRANSFORMS)?;
    fs::write(at(name), bytes)?;
    Ok(folder)
}

/// Reads a capture with everything in it, and checks what was read.
fn read_capture(name: &str, bytes: &[u8]) {
    let Ok(folder) = capture_with(name, bytes) else {
        return;
    };
    let Ok(capture) = read(folder.path(), &ReadOptions::default()) else {
        return;
    };
    let mesh = &capture.mesh;
    assert!(mesh.positions.iter().all(|p| p.is_finite()));
    assert_eq!(mesh.object_of.len(), mesh.triangles.len());
    assert!(
        mesh.object_of
            .iter()
            .all(|&o| (o as usize) < mesh.objects.len())
    );
    assert!(
        mesh.triangles
            .iter()
            .flatten()
            .all(|&i| (i as usize) < mesh.positions.len())
    );
    for frame in &capture.frames {
        if let Ok(photograph) = frame.load() {
            assert!(photograph.pixels.iter().all(|p| p.is_finite()));
        }
    }
}

/// transforms.json.
pub fn transforms(bytes: &[u8]) {
    read_capture("transforms.json", bytes);
}

/// The mesh as OBJ.
pub fn obj(bytes: &[u8]) {
    read_capture("mesh.obj", bytes);
}

/// The mesh as PLY, which goes before the OBJ.
pub fn ply(bytes: &[u8]) {
    read_capture("mesh.ply", bytes);
}

/// The mesh as GLB, which goes before the others.
pub fn gltf(bytes: &[u8]) {
    read_capture("mesh.glb", bytes);
}

/// A photograph, whose format is told from its content.
pub fn photograph(bytes: &[u8]) {
    read_capture("images/000.png", bytes);
}

fn object(name: &str, bytes: &[u8]) {
    let Ok(folder) = tempdir() else { return };
    let path = folder.path().join(name);
    if fs::write(&path, bytes).is_ok()
        && let Ok(object) = ObjectModel::read(&path)
    {
        let (low, high) = object.bounds();
        assert!(low.is_finite() && high.is_finite());
    }
}

/// An object to be inserted, as OBJ.
pub fn object_obj(bytes: &[u8]) {
    object("a.obj", bytes);
}

/// The materials of an object to be inserted.
pub fn object_mtl(bytes: &[u8]) {
    let Ok(folder) = tempdir() else { return };
    let obj = format!("mtllib a.mtl\nusemtl paint\n{MESH}");
    let at = |name: &str| folder.path().join(name);
    if fs::write(at("a.obj"), obj).is_ok()
        && fs::write(at("t.png"), PHOTOGRAPH).is_ok()
        && fs::write(at("a.mtl"), bytes).is_ok()
        && let Ok(object) = ObjectModel::read(&at("a.obj"))
    {
        let (low, high) = object.bounds();
        assert!(low.is_finite() && high.is_finite());
    }
}

/// An object to be inserted, as GLB.
pub fn object_gltf(bytes: &[u8]) {
    object("a.glb", bytes);
}

/// The sound capture, opened once; `None` where the disk fails.
pub fn opened() -> Option<&'static OpenCapture> {
    static OPENED: OnceLock<Option<OpenCapture>> = OnceLock::new();
    let open_it = || {
        let folder = capture_with("mesh.obj", MESH.as_bytes()).ok()?;
        open(
            &Source::Folder(folder.path().to_owned()),
            &OpenOptions::default(),
        )
        .ok()
    };
    OPENED.get_or_init(open_it).as_ref()
}

/// Stops a solve at its first word.
struct Stop;

impl Observer for Stop {
    fn observe(&mut self, _: &Progress, _: &Estimate) -> Control {
        Control::Stop
    }
}

/// Goes on from saved results as `relit render` and `relit solve --resume` do.
fn go_on(saved: Result<save::Saved>) {
    let (Ok(saved), Some(capture)) = (saved, opened()) else {
        return;
    };
    if let Ok(estimate) = saved.estimate_by_name(capture) {
        let lit = estimate.lit(&capture.scene);
        assert_eq!(lit.materials.len(), capture.scene.objects.len());
    }
    if let Some(checkpoint) = &saved.checkpoint {
        let problem = Problem {
            scene: capture.scene.clone(),
            photographs: capture.photographs.clone(),
        };
        // A single small step of each solver is enough.
        let mut settings = saved.settings.clone();
        (settings.batch, settings.samples, settings.bounces) = (1, 1, 2);
        let _ = solve(&problem, &settings, Some(checkpoint), &mut Stop);
    }
}

/// A folder that holds one file.
///
/// # Errors
/// The disk fails.
pub fn results_with(name: &str, bytes: &[u8]) -> Io<TempDir> {
    let folder = tempdir()?;
    fs::write(folder.path().join(name), bytes)?;
    Ok(folder)
}

/// estimate.json of saved results.
pub fn estimate(bytes: &[u8]) {
    if let Ok(folder) = results_with(save::ESTIMATE, bytes) {
        go_on(save::load(folder.path()));
    }
}

/// checkpoint.json of a solve that was broken off.
pub fn checkpoint(bytes: &[u8]) {
    if let Ok(folder) = results_with(save::CHECKPOINT, bytes) {
        go_on(save::load_checkpoint(folder.path()));
    }
}

/// The maps beside estimate.json.
pub fn maps(bytes: &[u8]) {
    if let Ok(maps) = save::maps::decode(Path::new("maps"), bytes)
        && let Some(texels) = maps.texels
    {
        assert_eq!(texels.colors.colors.len(), texels.colors.layout.len());
    }
}

/// truth.json of a capture.
pub fn truth(bytes: &[u8]) {
    if let Ok(folder) = results_with("truth.json", bytes) {
        let _ = Truth::read(folder.path());
    }
}

/// What a session that saved by itself holds beside its estimate.
pub fn session(bytes: &[u8]) {
    if let Ok(folder) = results_with("session.json", bytes) {
        let _ = store::read_record(folder.path());
    }
}

/// A file's ending by whether it is a text.
fn ending(bytes: &[u8]) -> &'static str {
    let text = std::str::from_utf8(bytes).is_ok_and(|text| !text.contains('\0'));
    if text { "txt" } else { "bin" }
}

/// Files in a folder of their own.
fn folder_of(files: &[(&str, &[u8])]) -> Io<TempDir> {
    let folder = tempdir()?;
    for (name, bytes) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap_or(folder.path()))?;
        fs::write(path, bytes)?;
    }
    Ok(folder)
}

/// A scan of COLMAP, with a photograph and a mesh.
///
/// # Errors
/// The disk fails.
pub fn colmap(cameras: &[u8], images: &[u8]) -> Io<TempDir> {
    let end = ending(images);
    folder_of(&[
        (&format!("cameras.{end}"), cameras),
        (&format!("images.{end}"), images),
        ("images/a.png", PHOTOGRAPH),
        ("meshed-poisson.ply", SCANNED),
    ])
}

/// A scan of Nerfstudio: its transforms.json, of which captures know a part, with a photograph and a mesh.
///
/// # Errors
/// The disk fails.
pub fn nerfstudio_scan(bytes: &[u8]) -> Io<TempDir> {
    folder_of(&[
        ("transforms.json", bytes),
        ("images/a.png", PHOTOGRAPH),
        ("mesh.ply", SCANNED),
    ])
}

/// A scan of Open3D: its trajectory as `.log` or JSON, with a photograph, a depth image and a mesh.
///
/// # Errors
/// The disk fails.
pub fn trajectory_scan(bytes: &[u8]) -> Io<TempDir> {
    let end = if bytes.first() == Some(&b'{') {
        "json"
    } else {
        "log"
    };
    folder_of(&[
        (&format!("trajectory.{end}"), bytes),
        ("color/0.png", PHOTOGRAPH),
        ("depth/0.png", DEPTH),
        ("integrated.ply", SCANNED),
    ])
}

/// Imports a scan, writes it as a capture and reads that.
fn import(scan: Io<TempDir>) {
    let Ok(folder) = scan else { return };
    let options = ImportOptions::default();
    let Ok(scan) = import::read(folder.path(), &options, &mut |_, _| {}) else {
        return;
    };
    assert!(scan.frames.iter().all(|f| f.pose.center.is_finite()));
    assert!(scan.mesh.positions.iter().all(|p| p.is_finite()));
    let out = folder.path().join("capture");
    if export::import::write(&out, &scan).is_ok() {
        let _ = read(&out, &ReadOptions::default());
    }
}

/// cameras.txt or cameras.bin of a COLMAP model.
pub fn colmap_cameras(bytes: &[u8]) {
    let images: &[u8] = match ending(bytes) {
        "txt" => include_bytes!("../seeds/colmap_images/images.txt"),
        _ => include_bytes!("../seeds/colmap_images/images.bin"),
    };
    import(colmap(bytes, images));
}

/// images.txt or images.bin of a COLMAP model.
pub fn colmap_images(bytes: &[u8]) {
    let cameras: &[u8] = match ending(bytes) {
        "txt" => include_bytes!("../seeds/colmap_cameras/opencv.txt"),
        _ => include_bytes!("../seeds/colmap_cameras/fisheye.bin"),
    };
    import(colmap(cameras, bytes));
}

/// transforms.json of a scan of Nerfstudio.
pub fn nerfstudio(bytes: &[u8]) {
    import(nerfstudio_scan(bytes));
}

/// The trajectory of a scan of Open3D.
pub fn trajectory(bytes: &[u8]) {
    import(trajectory_scan(bytes));
}
