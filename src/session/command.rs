//! What the window and the command line ask of a session: what is opened, and commands to the worker.

use crate::calibrate::held_out::HoldOut;
use crate::capture::place::Coordinates;
use crate::capture::read::CAMERAS;
use crate::capture::reading::Reading;
use crate::capture::regroup::Regroup;
pub use crate::compose::placement::Placement;
use crate::error::{Error, Result};
use crate::export::overwrite::{CHECKPOINT, ESTIMATE};
pub use crate::export::scene::Format as ExportFormat;
use crate::inverse::settings::Settings;
use crate::scene::camera::Camera;
use crate::session::edits::Edits;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Where a capture comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// The room built into the program.
    BuiltInRoom,
    /// A capture's folder.
    Folder(PathBuf),
}

/// What a window opens at its start.
#[derive(Debug, Clone)]
pub enum Start {
    /// A capture.
    Capture(Source, OpenOptions),
    /// Results of an earlier solve, in this folder.
    Results(PathBuf),
}

impl Source {
    /// Default folder of results: `relit-out/<capture>`.
    pub fn default_out(&self) -> PathBuf {
        let name = match self {
            Self::BuiltInRoom => Some("built-in-room".into()),
            Self::Folder(folder) => {
                let folder = std::path::absolute(folder).ok();
                folder.and_then(|folder| Some(named(&folder)?.to_owned()))
            }
        };
        Path::new("relit-out").join(name.unwrap_or_else(|| "capture".into()))
    }
}

/// Name of a capture by its folder; an imported one lies in `relit-out/NAME/capture`.
fn named(folder: &Path) -> Option<&std::ffi::OsStr> {
    let name = folder.file_name()?;
    let imported = || {
        let of_scan = folder.parent()?;
        let into = of_scan.parent()?.file_name()?;
        (name == "capture" && into == "relit-out").then(|| of_scan.file_name())?
    };
    Some(imported().unwrap_or(name))
}

/// What a path is that a person names: a capture, results, or a scan of another program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum PathKind {
    Capture(PathBuf),
    /// Results of a solve, to be resumed.
    Results(PathBuf),
    /// A folder that may be a scan of another program; only its import can tell.
    Scan(PathBuf),
}

impl PathKind {
    /// Identifies a path: a folder, or the `transforms.json` of a capture.
    ///
    /// # Errors
    /// The path does not exist, or is a file of another kind.
    pub fn at(path: &Path) -> Result<Self> {
        let holds = |name: &str| path.join(name).exists();
        if path.file_name().is_some_and(|name| name == CAMERAS) && path.is_file() {
            let folder = path.parent().unwrap_or(Path::new("."));
            return Ok(Self::Capture(folder.to_owned()));
        }
        if holds(CAMERAS) {
            return Ok(Self::Capture(path.to_owned()));
        }
        if holds(ESTIMATE) || holds(CHECKPOINT) {
            return Ok(Self::Results(path.to_owned()));
        }
        if path.is_dir() {
            return Ok(Self::Scan(path.to_owned()));
        }
        let found = match path.exists() {
            false => "there is nothing",
            true => "is no capture",
        };
        let remedy =
            "name a folder: a capture's, which holds transforms.json, a scan's, or one of results";
        Err(Error::file(path, found, remedy))
    }

    /// The folder that a scan is imported into: `capture` in the folder of its results.
    pub fn imported(scan: &Path) -> PathBuf {
        let source = Source::Folder(scan.to_owned());
        source.default_out().join("capture")
    }
}

/// A command to the worker, carried out between iterations. The painter gets what decides the pictures at once.
#[derive(Debug, Clone)]
pub enum Command {
    /// Open a capture and continue its last session; without one, solve it.
    Open(Source),
    /// Read the open capture again and solve it from scratch, in a new session.
    StartOver,
    /// Start or continue solving.
    Run,
    /// Pause between two iterations.
    Pause,
    /// Run one iteration, then pause.
    Step,
    /// Solve from the start in a new session, keeping edits and inserted objects.
    Reset,
    /// End the solve and keep the estimate.
    Finish,
    /// Continue from the last checkpoint, or from the start without one, with the known values of the edits.
    SolveOn,
    /// Replace the parameters. Those that are not live take effect at the next reset.
    Set(Box<Settings>),
    /// Render this view from now on.
    View(ViewRequest),
    /// Replace the inserted objects; an empty list removes all.
    Insert(Vec<Placement>),
    /// Whether inserted objects get the blur and grain of 8-bit photographs; by default they do.
    Match(bool),
    /// Replace the edits of the estimate.
    Edit(Edits),
    /// Write what `relit solve` writes, from the worker's estimate, into a folder.
    Save(PathBuf),
    /// Write a file for another program.
    Export(ExportRequest),
    /// Write the layers of the shown view's light as one OpenEXR file, like `relit render --layers`.
    SaveLayers(PathBuf),
    /// Continue a kept session, or results written by `Save` or `relit solve`.
    Resume(PathBuf),
    /// Delete a kept session.
    Remove(PathBuf),
    /// Read the open capture again with other options, keeping estimate and edits.
    Reframe(Box<OpenOptions>),
    /// Change the objects of the open capture, drop the estimate, and solve from the start.
    Regroup(Box<Regrouping>),
}

/// A change of a capture's objects.
#[derive(Debug, Clone)]
pub struct Regrouping {
    /// Hash of the capture. The command is ignored if another capture is open.
    pub hash: String,
    /// All changes since the capture was read; they replace earlier ones.
    pub changes: Vec<Regroup>,
    /// Edits of the estimate, by the indices of the new objects.
    pub edits: Edits,
}

/// A view to render.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewRequest {
    /// The camera.
    pub camera: ViewCamera,
    /// Long side of the picture in pixels, at most the photograph's.
    pub long_side: u32,
    /// Long side of the composite in pixels, at most the photograph file's; 0 if it is not shown.
    pub composite: u32,
    /// Whether the render is shown; if not, only a coarse one is made.
    pub render: bool,
    /// Whether to render the light of each lamp separately.
    pub layers: bool,
}

/// A camera to render from.
#[derive(Debug, Clone, PartialEq)]
pub enum ViewCamera {
    /// A photograph's camera.
    Frame(usize),
    /// Another camera, in scene coordinates.
    Free(Box<Camera>),
}

/// A file to write for another program.
#[derive(Debug, Clone, PartialEq)]
pub struct ExportRequest {
    /// Format of the file.
    pub format: ExportFormat,
    /// Path of the file.
    pub path: PathBuf,
}

/// Options for reading a capture.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct OpenOptions {
    /// Up axis in the capture's coordinates; `None` for the cameras' mean up.
    pub up: Option<DVec3>,
    /// Conventions of the files' numbers.
    #[serde(skip_serializing_if = "Reading::is_default")]
    pub reading: Reading,
    /// Scale and ground level.
    #[serde(flatten)]
    pub coordinates: Coordinates,
    /// Number of segments of a mesh without objects; `None` chooses it.
    pub segments: Option<u64>,
    /// Pixels held out of all fits; segmentation must not use them either.
    #[serde(flatten)]
    pub hold_out: HoldOut,
    /// Changes of its objects by hand.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub objects: Vec<Regroup>,
    /// Whether to check that the photographs show the mesh from their poses.
    #[serde(skip)]
    pub check_alignment: bool,
    /// Whether paths in the capture may leave its folder. Not stored in files, which may come from someone else.
    #[serde(skip)]
    pub allow_outside: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn results_of_imported_scans_lie_apart() {
        for (folder, name) in [
            ("/a/relit-out/flat/capture", "flat"),
            ("/a/relit-out/attic/capture", "attic"),
            ("/a/scans/capture", "capture"),
            ("/a/room", "room"),
        ] {
            let out = Source::Folder(folder.into()).default_out();
            assert_eq!(out, Path::new("relit-out").join(name));
        }
    }

    #[test]
    fn a_path_is_told_by_what_it_holds() {
        let place = tempfile::tempdir().expect("a folder");
        let folder = |name: &str, file: &str| {
            let folder = place.path().join(name);
            fs::create_dir(&folder).expect("a new folder");
            fs::write(folder.join(file), "{}").expect("a new file");
            folder
        };
        let capture = folder("capture", "transforms.json");
        let results = folder("results", "estimate.json");
        let killed = folder("killed", CHECKPOINT);
        let scan = folder("scan", "frame-000000.color.png");
        let at = |path: &Path| PathKind::at(path).expect("something is there");
        assert_eq!(at(&capture), PathKind::Capture(capture.clone()));
        let cameras = capture.join("transforms.json");
        assert_eq!(at(&cameras), PathKind::Capture(capture));
        assert_eq!(at(&results), PathKind::Results(results.clone()));
        assert_eq!(at(&killed), PathKind::Results(killed));
        assert_eq!(at(&scan), PathKind::Scan(scan));
        assert!(PathKind::at(&results.join("estimate.json")).is_err());
        assert!(PathKind::at(&place.path().join("nowhere")).is_err());
    }
}
