//! Creates folders atomically: complete or not at all.

use crate::capture::read::CAMERAS;
use crate::capture::read::confine::folder_of;
use crate::error::{Error, Result};
use crate::export::atomic::temporary_names;
use crate::export::overwrite;
use std::ffi::OsString;
use std::fs;
use std::io::ErrorKind::NotFound;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A temporary folder that is moved to its place when complete, and deleted otherwise.
#[derive(Debug)]
pub struct NewFolder {
    temporary: TempDir,
    place: PathBuf,
}

impl NewFolder {
    /// Creates the temporary folder beside `place`.
    ///
    /// # Errors
    /// The folder `place` is not empty and may not be replaced, or nothing can be written there.
    pub fn new(place: &Path) -> Result<Self> {
        let is_empty = match fs::read_dir(place) {
            Ok(mut entries) => entries.next().is_none(),
            Err(e) if e.kind() == NotFound => true,
            Err(e) => return Err(Error::io(place, &e)),
        };
        if !is_empty && !overwrite::is_permitted() {
            let problem = match place.join(CAMERAS).exists() {
                true => "holds a capture",
                false => "is not empty",
            };
            let remedy = "name a new folder, or add --overwrite to replace what has the same names";
            return Err(Error::file(place, problem, remedy));
        }
        let parent = folder_of(place);
        let temporary = fs::create_dir_all(parent)
            .and_then(|()| temporary_names(0o777).tempdir_in(parent))
            .map_err(|e| Error::io(parent, &e))?;
        Ok(Self {
            temporary,
            place: place.to_path_buf(),
        })
    }

    /// The temporary folder, to be written into.
    pub fn path(&self) -> &Path {
        self.temporary.path()
    }

    /// Moves the folder to its place; into an existing folder, file by file.
    ///
    /// # Errors
    /// A file cannot be moved.
    pub fn commit(self) -> Result<()> {
        if self.place.is_dir() {
            return merge(self.temporary.path(), &self.place);
        }
        fs::rename(self.temporary.path(), &self.place).map_err(|e| Error::io(&self.place, &e))?;
        // The folder was moved, so there is nothing to delete.
        let _ = self.temporary.keep();
        Ok(())
    }
}

/// Moves all files of a folder into another one, replacing those of the same names.
fn merge(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to).map_err(|e| Error::io(to, &e))?;
    let names = fs::read_dir(from)
        .and_then(|entries| entries.map(|entry| Ok(entry?.file_name())).collect());
    let mut names: Vec<OsString> = names.map_err(|e| Error::io(from, &e))?;
    // transforms.json last: a folder that has it is complete.
    names.sort_by_key(|name| (name == CAMERAS, name.clone()));
    for name in names {
        let (source, target) = (from.join(&name), to.join(&name));
        if source.is_dir() {
            merge(&source, &target)?;
        } else {
            fs::rename(&source, &target).map_err(|e| Error::io(&target, &e))?;
        }
    }
    Ok(())
}
