//! All files of a result appear together, or none does.

use crate::error::{Error, Result};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A folder being filled aside; [`Staging::commit`] moves its files over those of an earlier run.
#[derive(Debug)]
pub struct Staging {
    target: PathBuf,
    aside: TempDir,
    files: Vec<PathBuf>,
}

impl Staging {
    /// Starts filling; creates the target folder if need be.
    ///
    /// # Errors
    /// The target cannot be written.
    pub fn new(target: &Path) -> Result<Self> {
        fs::create_dir_all(target).map_err(|error| Error::io(target, &error))?;
        let aside = tempfile::Builder::new()
            .prefix(".relit-unfinished-")
            .tempdir_in(target)
            .map_err(|error| Error::io(target, &error))?;
        Ok(Self {
            target: target.to_owned(),
            aside,
            files: Vec::new(),
        })
    }

    /// Where to write the file that will be `name` in the target, e.g. `views/000.render.exr`.
    ///
    /// # Errors
    /// A folder on the way cannot be made.
    pub fn file(&mut self, name: impl AsRef<Path>) -> Result<PathBuf> {
        let path = self.aside.path().join(&name);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|error| Error::io(folder, &error))?;
        }
        self.files.push(name.as_ref().to_owned());
        Ok(path)
    }

    /// Writes a small file.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&mut self, name: impl AsRef<Path>, bytes: &[u8]) -> Result<()> {
        let path = self.file(&name)?;
        fs::write(&path, bytes).map_err(|error| Error::io(&self.target.join(name.as_ref()), &error))
    }

    /// Moves everything into place, in the order in which it was asked for, and removes the `stale` files of an
    /// earlier run that this one did not write.
    ///
    /// # Errors
    /// A file cannot be moved.
    pub fn commit(self, stale: &[PathBuf]) -> Result<()> {
        for name in &self.files {
            let target = self.target.join(name);
            if let Some(folder) = target.parent() {
                fs::create_dir_all(folder).map_err(|error| Error::io(folder, &error))?;
            }
            fs::rename(self.aside.path().join(name), &target)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dropped_staging_leaves_everything_and_a_commit_replaces_it_all() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let read = |name: &str| fs::read_to_string(folder.path().join(name)).ok();
        fs::write(folder.path().join("a"), "old").expect("writes");
        fs::write(folder.path().join("stale"), "old").expect("writes");
        let mut dropped = Staging::new(folder.path()).expect("starts");
        dropped.write("a", b"new").expect("writes");
        drop(dropped);
        assert_eq!(read("a").as_deref(), Some("old"));

        let mut staging = Staging::new(folder.path()).expect("starts");
        staging.write("views/000.txt", b"v").expect("writes");
        staging.write("a", b"new").expect("writes");
        staging
            .commit(&["a".into(), "stale".into(), "never-there".into()])
            .expect("moves");
        assert_eq!(read("a").as_deref(), Some("new"));
        assert_eq!(read("views/000.txt").as_deref(), Some("v"));
        assert_eq!(read("stale"), None);
        assert_eq!(fs::read_dir(folder.path()).expect("lists").count(), 2);
    }
}
