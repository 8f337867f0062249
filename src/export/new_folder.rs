//! Folders that appear whole or not at all.

use crate::capture::read::CAMERAS;
use crate::error::{Error, Result};
use crate::export::atomic::temporary_names;
use crate::export::overwrite;
use std::fs;
use std::io::ErrorKind::NotFound;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A folder beside the one wanted, which takes its place when it is complete and vanishes otherwise.
#[derive(Debug)]
pub struct NewFolder {
    aside: TempDir,
    place: PathBuf,
}

impl NewFolder {
    /// Starts to fill one.
    ///
    /// # Errors
    /// There is something in the place where it is to be and that may not be replaced, or nothing can be written there.
    pub fn new(place: &Path) -> Result<Self> {
        let is_empty = match fs::read_dir(place) {
            Ok(mut entries) => entries.next().is_none(),
            Err(e) if e.kind() == NotFound => true,
            Err(e) => return Err(Error::io(place, &e)),
        };
        if !is_empty && !overwrite::is_permitted() {
            return Err(Error::file(
                place,
                match place.join(CAMERAS).exists() {
                    true => "holds a capture",
                    false => "is not empty",
                },
                "name a new folder, or add --overwrite to replace what has the same names",
            ));
        }
        let parent = match place.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        fs::create_dir_all(parent).map_err(|e| Error::io(parent, &e))?;
        let aside = temporary_names(0o777)
            .tempdir_in(parent)
            .map_err(|e| Error::io(parent, &e))?;
        Ok(Self {
            aside,
            place: place.to_path_buf(),
        })
    }

    /// Where to write what will be in it.
    pub fn path(&self) -> &Path {
        self.aside.path()
    }

    /// Puts it into its place; into a folder that is there, file by file.
    ///
    /// # Errors
    /// Something cannot be moved.
    pub fn take_its_place(self) -> Result<()> {
        if self.place.is_dir() {
            return merge(self.aside.path(), &self.place);
        }
        fs::rename(self.aside.path(), &self.place).map_err(|e| Error::io(&self.place, &e))?;
        // Nothing is left to take away.
        let _ = self.aside.keep();
        Ok(())
    }
}

/// Moves all files of a folder into another one, over those of the same names.
fn merge(from: &Path, to: &Path) -> Result<()> {
    let io = |path: &Path| {
        let path = path.to_owned();
        move |e: std::io::Error| Error::io(&path, &e)
    };
    fs::create_dir_all(to).map_err(io(to))?;
    let mut names = Vec::new();
    for entry in fs::read_dir(from).map_err(io(from))? {
        names.push(entry.map_err(io(from))?.file_name());
    }
    // A folder that has them is complete.
    names.sort_by_key(|name| (name == CAMERAS, name.clone()));
    for name in names {
        let (source, target) = (from.join(&name), to.join(&name));
        if source.is_dir() {
            merge(&source, &target)?;
        } else {
            fs::rename(&source, &target).map_err(io(&target))?;
        }
    }
    Ok(())
}
