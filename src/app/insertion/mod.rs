//! The inserted objects as the window edits them: placed, moved, duplicated, hidden.

pub mod handles;
pub mod models;
pub mod transform;

use crate::compose::placement::Placement;
use glam::DVec3;
use models::Models;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

pub struct Insertions {
    pub objects: Vec<Placement>,
    /// The one that is edited.
    pub chosen: Option<usize>,
    /// Whether they take the blur and the grain of 8-bit photographs.
    pub finish: bool,
    /// The shapes of the objects' files.
    pub models: Models,
}

impl Default for Insertions {
    fn default() -> Self {
        Self {
            objects: Vec::new(),
            chosen: None,
            finish: true,
            models: Models::default(),
        }
    }
}

/// Objects that are being added: the path as typed, and files that are read first.
#[derive(Debug, Default)]
pub struct Adding {
    pub path: String,
    /// Whether the field for a path is to take the keys.
    pub typing: bool,
    pub wanted: Vec<PathBuf>,
    /// Why the last file did not join them.
    pub problem: Option<String>,
}

/// Endings that can be inserted.
pub const ENDINGS: [&str; 3] = ["obj", "glb", "gltf"];

/// Whether a file's ending is that of an object.
pub fn is_object(path: &Path) -> bool {
    let is_known = |ending: &OsStr| {
        ENDINGS
            .iter()
            .any(|known| ending.eq_ignore_ascii_case(known))
    };
    path.extension().is_some_and(is_known)
}

/// The name of an object's file, without its ending.
pub fn name(placement: &Placement) -> String {
    let stem = placement.file.file_stem().unwrap_or("object".as_ref());
    stem.to_string_lossy().into_owned()
}

impl Insertions {
    /// Adds an object at `at` and chooses it.
    pub fn add(&mut self, file: PathBuf, at: Option<DVec3>, scale: f64) {
        self.objects.push(Placement {
            scale,
            ..Placement::new(file, at)
        });
        self.chosen = self.objects.len().checked_sub(1);
    }

    pub fn chosen(&self) -> Option<(usize, &Placement)> {
        let index = self.chosen?;
        Some((index, self.objects.get(index)?))
    }

    /// Copies the chosen object, a little aside along `aside`.
    pub fn duplicate(&mut self, aside: DVec3) {
        if let Some((_, object)) = self.chosen() {
            let mut copy = object.clone();
            copy.at = copy.at.map(|at| at + aside);
            self.objects.push(copy);
            self.chosen = self.objects.len().checked_sub(1);
        }
    }

    /// Takes the chosen object away.
    pub fn delete(&mut self) {
        if let Some((index, _)) = self.chosen() {
            self.objects.remove(index);
            let last = self.objects.len().checked_sub(1);
            self.chosen = last.map(|last| index.min(last));
        }
    }

    /// Loads the objects that a capture was opened with, in place of those before.
    pub fn take_up(&mut self, placements: &[Placement]) {
        self.objects = placements.to_vec();
        self.chosen = self.objects.len().checked_sub(1);
    }

    pub fn visible(&self) -> Vec<Placement> {
        let visible = self.objects.iter().filter(|object| !object.hidden);
        visible.cloned().collect()
    }

    /// Replaces all objects, as undo does.
    pub fn replace(&mut self, objects: Vec<Placement>) {
        if self.objects != objects {
            let last = objects.len().checked_sub(1);
            self.chosen = last.map(|last| self.chosen.unwrap_or(last).min(last));
            self.objects = objects;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replacing_keeps_a_choice_and_chooses_the_last_where_there_was_none() {
        let mut insertions = Insertions::default();
        insertions.add("chair.glb".into(), Some(DVec3::ZERO), 1.0);
        insertions.duplicate(DVec3::X);
        let before = insertions.objects.clone();
        insertions.delete();
        insertions.delete();
        insertions.replace(before);
        assert_eq!((insertions.objects.len(), insertions.chosen), (2, Some(1)));
    }

    #[test]
    fn objects_are_told_by_their_ending() {
        assert!(is_object(Path::new("a/Chair.OBJ")) && is_object(Path::new("b.glb")));
        assert!(!is_object(Path::new("capture")) && !is_object(Path::new("a.png")));
    }
}
