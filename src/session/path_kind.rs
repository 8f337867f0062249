//! The kind of a path that a person names: a capture, results, or a scan of another program.

use crate::capture::read::CAMERAS;
use crate::error::{Error, Result};
use crate::session::command::Source;
use crate::session::save::{CHECKPOINT, ESTIMATE};
use std::path::{Path, PathBuf};

/// The content of a path.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PathKind {
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

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
