//! What the window or the command line asks of the worker.

use crate::calibrate::held_out::HoldOut;
use crate::capture::place::Coordinates;
use crate::capture::reading::Reading;
use crate::capture::regroup::Regroup;
pub use crate::compose::placement::Placement;
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

/// What a window begins with.
#[derive(Debug, Clone)]
pub enum Start {
    /// A capture.
    Capture(Source, OpenOptions),
    /// Results of an earlier solve, in this folder.
    Results(PathBuf),
}

impl Source {
    /// The folder that results go into where none is named: `relit-out/<capture>`.
    pub fn default_out(&self) -> PathBuf {
        let name = match self {
            Self::BuiltInRoom => "built-in-room".into(),
            Self::Folder(folder) => std::path::absolute(folder)
                .ok()
                .and_then(|path| Some(named(&path)?.to_owned()))
                .unwrap_or_else(|| "capture".into()),
        };
        Path::new("relit-out").join(name)
    }
}

/// What a capture is called by its folder: an imported one lies in `relit-out/NAME/capture`.
fn named(folder: &Path) -> Option<&std::ffi::OsStr> {
    let name = folder.file_name()?;
    let imported = || {
        let of_scan = folder.parent()?;
        let into = of_scan.parent()?.file_name()?;
        (name == "capture" && into == "relit-out").then(|| of_scan.file_name())?
    };
    Some(imported().unwrap_or(name))
}

/// A request to the worker, taken between iterations.
#[derive(Debug, Clone)]
pub enum Command {
    /// Loads a capture and goes on with its last session; without one it is solved.
    Open(Source),
    /// Reads the open capture anew and solves it as if it had never been open; the session so far is kept.
    StartOver,
    /// Starts or goes on.
    Run,
    /// Stops between two iterations and keeps everything.
    Pause,
    /// One iteration, then pause.
    Step,
    /// Solves anew, with the changes made by hand and the inserted objects; the session so far is kept.
    Reset,
    /// Ends the solve, keeping the estimate.
    Finish,
    /// Solves on from the last checkpoint, or from the start where there is none, with what the edits say is known.
    SolveOn,
    /// Replaces the parameters; those that are not live take effect at the next reset.
    Set(Box<Settings>),
    /// Which view to keep rendering; replaces the view asked for before.
    View(ViewRequest),
    /// The inserted objects, all of them; replaces those before. Empty takes them away.
    Insert(Vec<Placement>),
    /// Whether inserted objects take the blur and the grain of 8-bit photographs; they do unless told otherwise.
    Match(bool),
    /// The changes made by hand to what is found, all of them; replaces those before.
    Edit(Edits),
    /// Writes what `relit solve` writes, into a folder, from the worker's own estimate.
    Save(PathBuf),
    /// Writes one file for another program.
    Export(ExportRequest),
    /// Writes the layers of the shown view's light as one OpenEXR file, as `relit render --layers` does.
    SaveLayers(PathBuf),
    /// Goes on with a session that is kept, or with what `Save` or `relit solve` wrote into a folder.
    Resume(PathBuf),
    /// Removes a session that is kept, for good.
    Remove(PathBuf),
    /// Reads the open capture again with other options, keeping what was found and changed.
    Reframe(Box<OpenOptions>),
    /// Changes the objects of the open capture. What was found is forgotten, and the solve starts over.
    Regroup(Box<Regrouping>),
    /// Ends the worker.
    Quit,
}

/// Other objects of a capture.
#[derive(Debug, Clone)]
pub struct Regrouping {
    /// Which capture, by its hash; nothing happens where another one is open by now.
    pub hash: String,
    /// All changes since the capture was read, in place of those before.
    pub changes: Vec<Regroup>,
    /// The changes made by hand to what is found, by the new objects' places.
    pub edits: Edits,
}

/// What to look at.
#[derive(Debug, Clone)]
pub struct ViewRequest {
    /// From where.
    pub camera: ViewCamera,
    /// Long side of the picture in pixels, at most the photograph's.
    pub long_side: u32,
    /// Long side in pixels of the frame's photograph as it was changed, at most its file's; 0 where nobody looks at it.
    pub composite: u32,
    /// Whether anybody looks at the re-render; without it there is a coarse one alone.
    pub render: bool,
    /// Whether the light of each lamp is kept apart.
    pub layers: bool,
}

/// A camera to render from.
#[derive(Debug, Clone)]
pub enum ViewCamera {
    /// A photograph's own.
    Frame(usize),
    /// Any other, in scene coordinates.
    Free(Box<Camera>),
}

/// A file to write for another program.
#[derive(Debug, Clone, PartialEq)]
pub struct ExportRequest {
    /// What to write.
    pub format: ExportFormat,
    /// Where.
    pub path: PathBuf,
}

/// How a capture is read.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct OpenOptions {
    /// Up axis in the capture's coordinates; `None` takes the cameras' mean up.
    pub up: Option<DVec3>,
    /// How the files' numbers are meant.
    #[serde(skip_serializing_if = "Reading::is_default")]
    pub reading: Reading,
    /// Scale and ground.
    #[serde(flatten)]
    pub coordinates: Coordinates,
    /// Number of segments that a mesh without objects is cut into; `None` chooses.
    pub segments: Option<u64>,
    /// What says nothing when a mesh is cut into segments, as it is kept out of every fit.
    #[serde(flatten)]
    pub hold_out: HoldOut,
    /// How its objects were changed by hand.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub objects: Vec<Regroup>,
    /// Whether it is looked whether the photographs show the mesh from their poses.
    #[serde(skip)]
    pub check_alignment: bool,
    /// Whether paths in the capture may lead out of its folder. Never kept in files, which may be someone else's.
    #[serde(skip)]
    pub allow_outside: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_of_imported_scans_lie_apart() {
        let out = |folder: &str| Source::Folder(folder.into()).default_out();
        assert_eq!(
            out("/a/relit-out/flat/capture"),
            Path::new("relit-out/flat")
        );
        assert_eq!(
            out("/a/relit-out/attic/capture"),
            Path::new("relit-out/attic")
        );
        assert_eq!(out("/a/scans/capture"), Path::new("relit-out/capture"));
        assert_eq!(out("/a/room"), Path::new("relit-out/room"));
    }
}
