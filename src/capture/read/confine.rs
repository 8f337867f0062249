//! Confines the paths in a capture's files to its folder.

use crate::capture::inputs;
use crate::error::{Error, Result};
use std::path::{Component, Path, PathBuf};

/// The folder that a file lies in.
pub fn folder_of(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Larger files are refused.
const MAX_FILE_BYTES: u64 = 1 << 36;

/// A folder that file paths may not leave.
#[derive(Debug, Clone)]
pub struct Confine {
    folder: PathBuf,
    canonical: PathBuf,
    allow_outside: bool,
}

impl Confine {
    /// Confines paths to `folder`; with `allow_outside`, any path is allowed.
    ///
    /// # Errors
    /// The folder cannot be resolved.
    pub fn new(folder: &Path, allow_outside: bool) -> Result<Self> {
        let canonical = folder.canonicalize().map_err(|e| Error::io(folder, &e))?;
        Ok(Self {
            folder: folder.to_path_buf(),
            canonical,
            allow_outside,
        })
    }

    /// The folder as the caller wrote it.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Resolves `path`, relative to `base` (a folder inside), to an existing regular file, and registers the file as an input.
    /// `place` names the field for messages.
    ///
    /// # Errors
    /// The path is empty, leaves the folder (also by a symbolic link), or leads to no regular file.
    pub fn file_from(&self, base: &Path, place: &str, path: &str) -> Result<PathBuf> {
        if path.is_empty() {
            return Err(Error::new(place, "the path is empty", "name a file"));
        }
        let full = self.written_path(base, path);
        if !self.allow_outside && !self.stays_inside(base, &full) {
            return Err(outside(place, path));
        }
        let resolved = full.canonicalize().map_err(|e| {
            Error::new(
                place,
                format!("{}: {e}", full.display()),
                "check the path and that the file is there",
            )
        })?;
        if !self.allow_outside && !resolved.starts_with(&self.canonical) {
            return Err(outside(place, path));
        }
        let metadata = resolved.metadata().map_err(|e| Error::io(&full, &e))?;
        if !metadata.is_file() {
            return Err(Error::new(
                place,
                format!("{} is not a regular file", full.display()),
                "name a file",
            ));
        }
        if metadata.len() > MAX_FILE_BYTES {
            return Err(Error::file(
                &full,
                format!("the file is larger than {MAX_FILE_BYTES} bytes"),
                "make it smaller",
            ));
        }
        inputs::note(&resolved);
        Ok(full)
    }

    /// [`Confine::file_from`] the folder itself.
    ///
    /// # Errors
    /// As [`Confine::file_from`].
    pub fn file(&self, place: &str, path: &str) -> Result<PathBuf> {
        self.file_from(&self.folder, place, path)
    }

    /// Whether [`Confine::file`] would refuse a path as leaving the folder, judged by its text alone.
    pub fn leads_out(&self, path: &str) -> bool {
        let full = self.written_path(&self.folder, path);
        !self.allow_outside && !self.stays_inside(&self.folder, &full)
    }

    /// Whether the folder has an entry at this path.
    pub fn holds(&self, name: &str) -> bool {
        self.written_path(&self.folder, name)
            .symlink_metadata()
            .is_ok()
    }

    /// Joins a path to `base`. Backslashes count as separators (Windows) unless a file with backslashes in its name exists.
    fn written_path(&self, base: &Path, path: &str) -> PathBuf {
        let full = base.join(path);
        let is_inside = || self.stays_inside(base, &full);
        if !path.contains('\\') || (is_inside() && full.symlink_metadata().is_ok()) {
            return full;
        }
        base.join(path.replace('\\', "/"))
    }

    /// Whether a path from `base` never leaves the folder on its way, or is an absolute path into the folder.
    fn stays_inside(&self, base: &Path, full: &Path) -> bool {
        let relative = match full.strip_prefix(base) {
            Ok(relative) => relative,
            Err(_) => {
                let canonical = full.strip_prefix(&self.canonical);
                let absolute = std::path::absolute(&self.folder).ok();
                let named = absolute.and_then(|folder| full.strip_prefix(folder).ok());
                let Some(relative) = canonical.ok().or(named) else {
                    return false;
                };
                return never_climbs(0, relative);
            }
        };
        let depth = base
            .strip_prefix(&self.folder)
            .map_or(0, |inner| inner.components().count() as i64);
        never_climbs(depth, relative)
    }
}

fn outside(place: &str, path: &str) -> Error {
    Error::new(
        place,
        format!("the path {path:?} leaves the capture's folder"),
        "copy the file into the folder, or pass --allow-outside if you trust the capture",
    )
}

/// Whether a relative path from a folder at `depth` never climbs above depth 0.
fn never_climbs(mut depth: i64, relative: &Path) -> bool {
    relative.components().all(|component| {
        match component {
            Component::Normal(_) => depth += 1,
            Component::CurDir => {}
            Component::ParentDir => depth -= 1,
            Component::RootDir | Component::Prefix(_) => return false,
        }
        depth >= 0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_cannot_leave_the_folder_unless_allowed() {
        let outer = tempfile::tempdir().unwrap();
        let folder = outer.path().join("capture");
        std::fs::create_dir_all(folder.join("images")).unwrap();
        std::fs::write(outer.path().join("secret"), "x").unwrap();
        std::fs::write(folder.join("images/a.png"), "x").unwrap();
        let confined = Confine::new(&folder, false).unwrap();
        assert!(confined.file("field", "images/../images/a.png").is_ok());
        assert!(confined.file("field", "images\\a.png").is_ok());
        let within = |path: &str| folder.join(path).display().to_string();
        assert!(confined.file("field", &within("images/a.png")).is_ok());
        let absolute = outer.path().join("secret");
        for path in [
            "../secret",
            "images/../../secret",
            "../capture/images/a.png",
            "..\\secret",
            "images\\..\\..\\secret",
            &within("../secret"),
            &within("images/../../capture/images/a.png"),
            absolute.to_str().unwrap(),
            "",
        ] {
            let error = confined.file("field", path).unwrap_err();
            assert_eq!(error.place, "field", "{path}");
        }
        assert!(confined.file("field", "images").is_err());
        assert!(confined.file("field", "images/none.png").is_err());
        let open = Confine::new(&folder, true).unwrap();
        assert!(open.file("field", "../secret").is_ok());
    }
}
