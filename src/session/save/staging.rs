//! Writes all files of results together: either all appear or none. They replace only results of the same capture,
//! and no inputs (see [`crate::export::overwrite`]).
//!
//! Several programs may write into the same folder: each fills a temporary folder, and they move their files one
//! after the other. Temporary folders of killed programs are deleted by the next one. Both need locks on folders,
//! which Windows and some network drives lack; there, programs must not share a folder.

use crate::error::{Error, Result};
use crate::export::atomic::write_bytes;
use crate::export::overwrite::{self, CaptureId};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Prefix of the names of temporary folders.
const UNFINISHED: &str = ".relit-unfinished-";

/// A temporary folder; [`Staging::commit`] moves its files to the target.
#[derive(Debug)]
pub struct Staging {
    target: PathBuf,
    temporary: TempDir,
    files: Vec<PathBuf>,
    /// Lock on the temporary folder, which shows others that it is in use.
    _in_use: Option<File>,
}

impl Staging {
    /// Creates the temporary folder for results of a capture, and the target folder if need be.
    ///
    /// # Errors
    /// The target holds something else, or cannot be written.
    pub fn new(target: &Path, capture: &CaptureId) -> Result<Self> {
        overwrite::check_results(target, capture)?;
        fs::create_dir_all(target).map_err(|error| Error::io(target, &error))?;
        let _lock = locked(target);
        remove_abandoned(target);
        let made = tempfile::Builder::new()
            .prefix(UNFINISHED)
            .tempdir_in(target);
        let temporary = made.map_err(|error| Error::io(target, &error))?;
        Ok(Self {
            target: target.to_owned(),
            _in_use: locked(temporary.path()),
            temporary,
            files: Vec::new(),
        })
    }

    /// The path to write the file to that will be `name` in the target, e.g. `views/000.render.exr`.
    pub fn file(&mut self, name: impl AsRef<Path>) -> Result<PathBuf> {
        let path = self.temporary.path().join(&name);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|error| Error::io(folder, &error))?;
        }
        self.files.push(name.as_ref().to_owned());
        Ok(path)
    }

    pub fn write(&mut self, name: impl AsRef<Path>, bytes: &[u8]) -> Result<()> {
        let path = self.file(&name)?;
        write_bytes(&path, bytes).map_err(|error| self.named(error))
    }

    /// Replaces the temporary path in an error by the target.
    pub fn named(&self, error: Error) -> Error {
        let [aside, target] =
            [self.temporary.path(), &self.target].map(|p| p.display().to_string());
        let place = error.place.replace(&aside, &target);
        Error { place, ..error }
    }

    /// Moves all files to the target, in the order of their creation, and deletes files of an earlier run that this
    /// one did not write: `stale` lists them while the target is locked.
    ///
    /// # Errors
    /// A file cannot be moved, or would replace an input.
    pub fn commit(self, stale: impl FnOnce(&Path) -> Vec<PathBuf>) -> Result<()> {
        let _lock = locked(&self.target);
        for name in &self.files {
            overwrite::check_input(&self.target.join(name))?;
        }
        let stale = stale(&self.target);
        for name in &self.files {
            let target = self.target.join(name);
            if let Some(folder) = target.parent() {
                fs::create_dir_all(folder).map_err(|error| Error::io(folder, &error))?;
            }
            fs::rename(self.temporary.path().join(name), &target)
                .map_err(|error| Error::io(&target, &error))?;
        }
        for name in stale.iter().filter(|name| !self.files.contains(name)) {
            let path = self.target.join(name);
            match fs::remove_file(&path) {
                Ok(()) => {}
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
                Err(error) => return Err(Error::io(&path, &error)),
            }
        }
        Ok(())
    }
}

/// Locks a folder for as long as the result lives, waiting if need be; `None` where folders have no locks.
fn locked(folder: &Path) -> Option<File> {
    let file = File::open(folder).ok()?;
    file.lock().ok()?;
    Some(file)
}

fn remove_abandoned(target: &Path) {
    for entry in fs::read_dir(target).into_iter().flatten().flatten() {
        let unfinished = entry.file_name().to_string_lossy().starts_with(UNFINISHED);
        let abandoned = || File::open(entry.path()).is_ok_and(|folder| folder.try_lock().is_ok());
        if unfinished && abandoned() {
            // Failing to delete it does no harm.
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn start(folder: &Path) -> Staging {
        let capture = CaptureId {
            hash: "1".to_owned(),
            folder: None,
        };
        Staging::new(folder, &capture).expect("starts")
    }

    #[test]
    fn a_dropped_staging_leaves_everything_and_a_commit_replaces_it_all() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let read = |name: &str| fs::read_to_string(folder.path().join(name)).ok();
        fs::write(folder.path().join("a"), "old").expect("writes");
        fs::write(folder.path().join("stale"), "old").expect("writes");
        let mut dropped = start(folder.path());
        dropped.write("a", b"new").expect("writes");
        drop(dropped);
        assert_eq!(read("a").as_deref(), Some("old"));

        let mut staging = start(folder.path());
        staging.write("views/000.txt", b"v").expect("writes");
        staging.write("a", b"new").expect("writes");
        let stale = ["a", "stale", "never-there"].map(PathBuf::from);
        staging.commit(|_| stale.to_vec()).expect("moves");
        assert_eq!(read("a").as_deref(), Some("new"));
        assert_eq!(read("views/000.txt").as_deref(), Some("v"));
        assert_eq!(read("stale"), None);
        assert_eq!(fs::read_dir(folder.path()).expect("lists").count(), 2);
    }
}
