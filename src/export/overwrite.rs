//! Protects inputs and other results from being overwritten.
//!
//! Every file is checked before it is written, by commands and by the window:
//!
//! - Files of a capture are kept: transforms.json, its truth, its mesh, and what a transforms.json in a folder above names,
//!   together with the other files in a subfolder that it names. Nor is a mesh written where the reader would take it for the
//!   capture's.
//! - Files of results (estimate.json and what `relit solve` writes beside it) are replaced only by results of the same capture:
//!   one with the same content or in the same place.
//! - Files that the same run has read are kept: inserted objects with their textures, cameras, scans, and what a capture names
//!   outside of its folder.
//! - Any other file is replaced, as by any program.
//!
//! [`permit`] (`--overwrite`) disables all checks.

use crate::capture::inputs;
use crate::capture::read::confine::folder_of;
use crate::capture::read::{CAMERAS, MESHES};
use crate::error::{Error, Result};
use serde::Deserialize;
use serde_json::Value;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// File name of the estimate, which later commands read.
pub const ESTIMATE: &str = "estimate.json";
/// File name of the report on the solve.
pub const REPORT: &str = "report.json";
/// File name of the checkpoint, from which a solve resumes.
pub const CHECKPOINT: &str = "checkpoint.json";
/// Folder of the pictures within results.
pub const VIEWS: &str = "views";
/// Other files of results, except maps.
const OTHER_FILES: [&str; 5] = [REPORT, "loss.csv", "loss.png", "scene.glb", VIEWS];

static PERMITTED: AtomicBool = AtomicBool::new(false);

/// Permits replacing any file, for the rest of the process.
pub fn permit() {
    PERMITTED.store(true, Ordering::Relaxed);
}

/// Whether any file may be replaced.
pub fn is_permitted() -> bool {
    PERMITTED.load(Ordering::Relaxed)
}

/// Refuses a file that belongs to a capture or to results, or that the run has read.
///
/// # Errors
/// The file is protected.
pub fn check(path: &Path) -> Result<()> {
    refuse(path, |_| true)
}

/// Refuses a file that belongs to a capture or that the run has read. For files of results, use [`check_results`] on the
/// folder.
///
/// # Errors
/// The file is protected.
pub fn check_input(path: &Path) -> Result<()> {
    refuse(path, |owner| !matches!(owner, Owner::Results(_)))
}

fn refuse(path: &Path, selects: impl Fn(&Owner) -> bool) -> Result<()> {
    if is_permitted() {
        return Ok(());
    }
    let what = match owner(path).filter(selects) {
        None => return Ok(()),
        Some(Owner::Capture(folder, what)) => {
            format!("is {what} of the capture in {}", folder.display())
        }
        Some(Owner::Results(folder)) => {
            format!("belongs to the results in {}", folder.display())
        }
        Some(Owner::Inputs) => "was read as an input".to_owned(),
    };
    let remedy = "name another file; the command line replaces it where --overwrite is added";
    Err(Error::file(path, what, remedy))
}

/// Identifies the capture of results.
#[derive(Debug, Clone)]
pub struct CaptureId {
    /// Hash of its content.
    pub hash: String,
    /// Its folder; `None` for the built-in room.
    pub folder: Option<PathBuf>,
}

/// Refuses a folder for the results of `capture` if it holds results of another capture, or files of the same names of no results.
///
/// # Errors
/// The folder is refused.
pub fn check_results(folder: &Path, capture: &CaptureId) -> Result<()> {
    if is_permitted() {
        return Ok(());
    }
    let remedy = "name another folder; the command line writes over it where --overwrite is added";
    let mut is_results = false;
    for name in [ESTIMATE, CHECKPOINT] {
        let path = folder.join(name);
        if !path.exists() {
            continue;
        }
        is_results = true;
        let existing = Reference::read(&path)
            .ok_or_else(|| Error::file(&path, "exists and holds no results of relit", remedy))?;
        if !existing.is_of(folder, capture) {
            let problem = format!("holds the results of another capture, {}", existing.name);
            return Err(Error::file(folder, problem, remedy));
        }
    }
    let other = OTHER_FILES.iter().map(|name| folder.join(name));
    match other.into_iter().find(|path| !is_results && path.exists()) {
        Some(path) => {
            let problem = "exists and belongs to no results of relit";
            Err(Error::file(&path, problem, remedy))
        }
        None => Ok(()),
    }
}

/// What a file belongs to.
enum Owner {
    /// The capture in a folder; and its role there.
    Capture(PathBuf, &'static str),
    /// The results in a folder.
    Results(PathBuf),
    /// The inputs of this run.
    Inputs,
}

fn owner(path: &Path) -> Option<Owner> {
    let place = place(path)?;
    let of_folder = place.ancestors().skip(1).find_map(|folder| {
        let name = place.strip_prefix(folder).ok()?;
        if let Some(what) = role_in_capture(folder, name, &place) {
            return Some(Owner::Capture(folder.to_owned(), what));
        }
        is_of_results(folder, name, &place).then(|| Owner::Results(folder.to_owned()))
    });
    let was_read = || (place.exists() && inputs::holds(&place)).then_some(Owner::Inputs);
    of_folder.or_else(was_read)
}

/// The path with its folder resolved. A symbolic link at its end is not followed, since the link itself would be replaced.
fn place(path: &Path) -> Option<PathBuf> {
    let named = folder_of(path).canonicalize().ok()?.join(path.file_name()?);
    match named.symlink_metadata() {
        // On case-insensitive disks, canonicalize gives the spelling on disk.
        Ok(metadata) if !metadata.is_symlink() => named.canonicalize().ok().or(Some(named)),
        _ => Some(named),
    }
}

fn is_of_results(folder: &Path, name: &Path, place: &Path) -> bool {
    let records = [ESTIMATE, CHECKPOINT];
    let first = name.iter().next().and_then(|n| n.to_str());
    let first = first.unwrap_or_default();
    let is_one = records.contains(&first)
        || OTHER_FILES.contains(&first)
        || (first.starts_with("maps-") && first.ends_with(".safetensors"));
    is_one && place.exists() && records.iter().any(|n| folder.join(n).is_file())
}

/// The role of a file in the capture of a folder, if it belongs to it.
fn role_in_capture(folder: &Path, name: &Path, place: &Path) -> Option<&'static str> {
    let cameras = folder.join(CAMERAS);
    if !cameras.is_file() {
        return None;
    }
    if name == Path::new(CAMERAS) {
        return Some("the cameras");
    }
    let (exists, is_mesh) = (place.exists(), MESHES.iter().any(|m| name == Path::new(m)));
    if exists && (name == Path::new("truth.json") || name.starts_with("truth")) {
        return Some("the truth");
    }
    if !exists && !is_mesh {
        return None;
    }
    let text = std::fs::read(&cameras).ok()?;
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&text);
    // An unreadable file may name anything.
    let Ok(file) = serde_json::from_slice::<Value>(text) else {
        return Some("beside the broken cameras");
    };
    if is_mesh && file.get("mesh_path").is_none_or(Value::is_null) {
        return Some("the mesh");
    }
    let named = |value: &Value, field: &str| -> Option<PathBuf> {
        let name = value.get(field)?.as_str()?;
        let as_written = self::place(&folder.join(name)).filter(|path| path.exists());
        as_written.or_else(|| self::place(&folder.join(name.replace('\\', "/"))))
    };
    let same_stem =
        |mesh: &PathBuf| mesh.parent() == place.parent() && mesh.file_stem() == place.file_stem();
    if exists && named(&file, "mesh_path").as_ref().is_some_and(same_stem) {
        return Some("the mesh");
    }
    let is_beside = |file: &PathBuf| {
        file == place
            || (exists && file.parent() == place.parent() && file.parent() != Some(folder))
    };
    let frames = file.get("frames").and_then(Value::as_array);
    frames.into_iter().flatten().find_map(|frame| {
        let is = |field: &str| named(frame, field).as_ref().is_some_and(is_beside);
        let depth = || is("depth_file_path").then_some("a depth image");
        let mask = || is("mask_path").then_some("a mask");
        let photograph = is("file_path").then_some("a photograph");
        photograph.or_else(depth).or_else(mask)
    })
}

/// The capture of results, as recorded in estimate.json and checkpoint.json.
#[derive(Deserialize)]
struct Reference {
    name: String,
    built_in: bool,
    relative: Option<String>,
    absolute: Option<PathBuf>,
    hash: String,
}

impl Reference {
    fn read(path: &Path) -> Option<Self> {
        #[derive(Deserialize)]
        struct Estimate {
            capture: Reference,
        }
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Results {
            Estimate(Estimate),
            Checkpoint { estimate: Estimate },
        }
        let file = BufReader::new(File::open(path).ok()?);
        Some(match serde_json::from_reader(file).ok()? {
            Results::Estimate(estimate) | Results::Checkpoint { estimate } => estimate.capture,
        })
    }

    fn is_of(&self, results: &Path, capture: &CaptureId) -> bool {
        if self.hash == capture.hash {
            return true;
        }
        let Some(folder) = &capture.folder else {
            return self.built_in;
        };
        let Ok(folder) = folder.canonicalize() else {
            return false;
        };
        let places = [
            self.relative.as_ref().map(|path| results.join(path)),
            self.absolute.clone(),
        ];
        (places.into_iter().flatten()).any(|path| path.canonicalize().is_ok_and(|p| p == folder))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn write(path: PathBuf, text: &str) {
        fs::create_dir_all(path.parent().expect("a folder")).expect("makes it");
        fs::write(path, text).expect("writes");
    }

    #[test]
    fn what_a_capture_or_results_hold_is_refused_and_nothing_else() {
        let outer = tempfile::tempdir().expect("a folder");
        let at = |name: &str| outer.path().join(name);
        let cameras = r#"{"mesh_path": "scan\\room.ply", "frames": [{"file_path": "images/a/0.png"}, {"file_path": "1.png"}]}"#;
        write(at("room/transforms.json"), cameras);
        let ours =
            "transforms.json truth.json scan/room.ply images/a/0.png images/a/left-out.png 1.png
            out/estimate.json out/report.json out/views/000.render.exr out/maps-1.safetensors";
        let others = "plain.png scan/notes.txt out/mine.png";
        for name in ours.split_whitespace().skip(1).chain(others.split(' ')) {
            write(at("room").join(name), "x");
        }
        let by_another_path = "images/../images/a/0.png";
        for name in ours.split_whitespace().chain([by_another_path]) {
            let refused = &format!("room/{name}");
            let error = check(&at(refused)).expect_err(refused);
            let said = error.place.contains(refused) && error.remedy.contains("--overwrite");
            assert!(said, "{error}");
        }
        let new = "images/a/new.png out/checkpoint.json ../new/folder/000.exr ../mesh.obj";
        for free in others.split(' ').chain(new.split(' ')) {
            check(&at("room").join(free)).expect(free);
        }
        write(at("hall/transforms.json"), r#"{"frames": []}"#);
        check(&at("hall/mesh.glb")).expect_err("it would be taken for the mesh");
        check(&at("room/mesh.glb")).expect("the cameras name another");
        assert!(check_input(&at("room/out/report.json")).is_ok());
        assert!(check_input(&at("room/1.png")).is_err());
    }

    #[test]
    fn results_make_room_only_for_those_of_their_capture() {
        let outer = tempfile::tempdir().expect("a folder");
        let at = |name: &str| outer.path().join(name);
        write(at("room/transforms.json"), "{}");
        write(at("hall/transforms.json"), "{}");
        let of = |hash: &str, folder: Option<PathBuf>| CaptureId {
            hash: hash.to_owned(),
            folder,
        };
        let own = |hash: &str, folder: &str| of(hash, Some(at(folder)));
        let estimate = r#"{"capture": {"name": "room", "built_in": false, "relative": "../room", "absolute": null, "hash": "1"}, "x": 1}"#;
        check_results(&at("out"), &own("1", "room")).expect("there is nothing");
        write(at("out/loss.csv"), "mine");
        check_results(&at("out"), &own("1", "room")).expect_err("a table of someone's");
        let checkpoint = format!("{{\"estimate\": {estimate}, \"checkpoint\": null}}");
        for (name, text) in [(ESTIMATE, estimate), (CHECKPOINT, &checkpoint)] {
            write(at("out").join(name), text);
            check_results(&at("out"), &own("1", "elsewhere")).expect("the same content");
            check_results(&at("out"), &own("2", "room")).expect("changed since");
            let error = check_results(&at("out"), &own("2", "hall")).expect_err("another capture");
            assert!(error.problem.contains("another capture, room"), "{error}");
            check_results(&at("out"), &of("2", None)).expect_err("the built-in room");
            fs::remove_file(at("out").join(name)).expect("removes");
        }
        write(at("out").join(ESTIMATE), "[1]");
        check_results(&at("out"), &own("1", "room")).expect_err("someone's file");
    }
}
