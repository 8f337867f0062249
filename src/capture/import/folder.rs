//! The folder of a scan: listings and regular files of bounded size. What is missing or leads out of the folder is an error.

use crate::capture::read::confine::Confine;
use crate::error::{Error, Result};
use serde_json::Value;
use std::path::{Path, PathBuf};

const MAX_TEXT: u64 = 1 << 28;
const MAX_ENTRIES: usize = 1 << 20;

/// A folder that paths may not leave.
pub struct Folder {
    confine: Confine,
}

impl Folder {
    pub fn new(path: &Path) -> Result<Self> {
        if !path.is_dir() {
            return Err(Error::file(
                path,
                "is not a folder",
                "name the folder that holds the scan",
            ));
        }
        Ok(Self {
            confine: Confine::new(path, false)?,
        })
    }

    pub fn confine(&self) -> &Confine {
        &self.confine
    }

    /// Full path of an entry, unchecked.
    pub fn path(&self, name: &str) -> PathBuf {
        self.confine.folder().join(name)
    }

    /// Whether an entry of this name exists.
    pub fn has(&self, name: &str) -> bool {
        self.confine.holds(name)
    }

    pub fn has_folder(&self, name: &str) -> bool {
        self.path(name).is_dir()
    }

    pub fn first<'a>(&self, names: &[&'a str]) -> Option<&'a str> {
        names.iter().copied().find(|name| self.has(name))
    }

    /// The existing file of this name; `place` names the field for messages.
    pub fn file(&self, place: &str, name: &str) -> Result<PathBuf> {
        self.confine.file(place, name)
    }

    /// The existing file of this name.
    pub fn existing(&self, name: &str) -> Result<PathBuf> {
        self.file(&self.path(name).display().to_string(), name)
    }

    pub fn json(&self, name: &str) -> Result<Value> {
        serde_json::from_str(&self.text(name)?).map_err(|e| {
            let problem = format!("is not valid JSON: {e}");
            Error::file(&self.path(name), problem, "correct the file")
        })
    }

    /// A text file's content; bytes that are not UTF-8 are replaced.
    pub fn text(&self, name: &str) -> Result<String> {
        let bytes = self.bytes(name, MAX_TEXT)?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }

    /// A file's content of at most `max` bytes.
    pub fn bytes(&self, name: &str, max: u64) -> Result<Vec<u8>> {
        let file = self.existing(name)?;
        let length = file.metadata().map_err(|e| Error::io(&file, &e))?.len();
        if length > max {
            return Err(Error::file(
                &file,
                format!("has {length} bytes, more than the limit of {max}"),
                "split the scan",
            ));
        }
        std::fs::read(&file).map_err(|e| Error::io(&file, &e))
    }

    /// Names of the entries of a subfolder (`""` for the folder itself), in natural order (`9` before `10`).
    pub fn names(&self, inside: &str) -> Result<Vec<String>> {
        let path = self.path(inside);
        let whole = self.confine.folder().canonicalize();
        let resolved = path.canonicalize().map_err(|e| Error::io(&path, &e))?;
        if !whole.is_ok_and(|whole| resolved.starts_with(whole)) {
            return Err(Error::file(
                &path,
                "leads out of the imported folder",
                "copy it into the folder",
            ));
        }
        let entries = std::fs::read_dir(&path).map_err(|e| Error::io(&path, &e))?;
        let mut names = Vec::new();
        for entry in entries {
            let entry = entry.map_err(|e| Error::io(&path, &e))?;
            if let Ok(name) = entry.file_name().into_string() {
                names.push(name);
            }
            if names.len() > MAX_ENTRIES {
                return Err(Error::file(
                    &path,
                    format!("has more than {MAX_ENTRIES} entries"),
                    "split the scan",
                ));
            }
        }
        names.sort_by_cached_key(|name| natural_key(name));
        Ok(names)
    }
}

/// The path of an entry of a subfolder, which is `""` for the folder itself.
pub fn inside(subfolder: &str, name: &str) -> String {
    match subfolder {
        "" => name.to_owned(),
        _ => format!("{subfolder}/{name}"),
    }
}

/// Sort key of the natural order: runs of letters, and runs of digits by value.
fn natural_key(name: &str) -> Vec<(String, u64, String)> {
    let mut parts: Vec<(String, u64, String)> = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let split = rest
            .find(|c: char| c.is_ascii_digit())
            .unwrap_or(rest.len());
        let (letters, after) = rest.split_at(split);
        let end = after
            .find(|c: char| !c.is_ascii_digit())
            .unwrap_or(after.len());
        let (digits, after) = after.split_at(end);
        let number = digits.parse().unwrap_or(u64::MAX);
        parts.push((letters.to_owned(), number, digits.to_owned()));
        rest = after;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_order_by_value() {
        let mut names = ["frame-10", "frame-9", "a", "frame-010", "2", "11"];
        names.sort_by_cached_key(|name| natural_key(name));
        let ordered = ["2", "11", "a", "frame-9", "frame-010", "frame-10"];
        assert_eq!(names, ordered);
    }
}
