//! The inserted objects as the window edits them: placed, moved, duplicated, hidden.

mod adding;
pub mod handles;
pub mod models;

use crate::session::command::Placement;
use glam::DVec3;
use handles::Handle;
use models::Models;
use std::path::{Path, PathBuf};

/// An inserted object.
#[derive(Debug, Clone, PartialEq)]
pub struct Inserted {
    /// What the worker is told.
    pub placement: Placement,
}

impl Inserted {
    /// The file's name without its ending.
    pub fn name(&self) -> String {
        self.placement.file.file_stem().map_or_else(
            || "object".to_owned(),
            |stem| stem.to_string_lossy().into_owned(),
        )
    }
}

/// All inserted objects and how they are being edited.
pub struct Insertions {
    /// The objects, in the order in which they were added.
    pub objects: Vec<Inserted>,
    /// The one that is edited.
    pub chosen: Option<usize>,
    /// Whether the next click in a view places the chosen object.
    pub placing: bool,
    /// The handle that is being dragged.
    pub dragged: Option<Handle>,
    /// Whether they take the blur and the grain of 8-bit photographs.
    pub finish: bool,
    /// The path as typed.
    pub path: String,
    /// Whether the field for a path is to take the keys.
    pub typing: bool,
    /// Files that are read before they join the objects.
    pub wanted: Vec<PathBuf>,
    /// Why the last file did not join them.
    pub trouble: Option<String>,
    /// The shapes of the objects' files.
    pub models: Models,
}

impl Default for Insertions {
    fn default() -> Self {
        Self {
            objects: Vec::new(),
            chosen: None,
            placing: false,
            dragged: None,
            finish: true,
            path: String::new(),
            typing: false,
            wanted: Vec::new(),
            trouble: None,
            models: Models::default(),
        }
    }
}

/// Endings that can be inserted.
pub const ENDINGS: [&str; 3] = ["obj", "glb", "gltf"];

/// Whether a file's ending is that of an object.
pub fn is_object(path: &Path) -> bool {
    path.extension()
        .and_then(|ending| ending.to_str())
        .is_some_and(|ending| ENDINGS.contains(&ending.to_ascii_lowercase().as_str()))
}

impl Insertions {
    /// Adds an object at `at`, chooses it, and waits for a click that places it.
    pub fn add(&mut self, file: PathBuf, at: Option<DVec3>) {
        self.objects.push(Inserted {
            placement: Placement {
                file,
                at,
                scale: 1.0,
                rotate: 0.0,
                hidden: false,
            },
        });
        self.chosen = Some(self.objects.len() - 1);
        self.placing = true;
    }

    /// The chosen object.
    pub fn chosen(&mut self) -> Option<&mut Inserted> {
        self.chosen.and_then(|index| self.objects.get_mut(index))
    }

    /// Puts the chosen object at a point of the capture; false where none is chosen.
    pub fn place(&mut self, at: DVec3) -> bool {
        let Some(object) = self.chosen() else {
            return false;
        };
        object.placement.at = Some(at);
        true
    }

    /// Copies the chosen object, a little aside along `aside`.
    pub fn duplicate(&mut self, aside: DVec3) {
        let Some(mut copy) = self.chosen().cloned() else {
            return;
        };
        copy.placement.at = copy.placement.at.map(|at| at + aside);
        self.objects.push(copy);
        self.chosen = Some(self.objects.len() - 1);
    }

    /// Takes the chosen object away.
    pub fn delete(&mut self) {
        if let Some(index) = self.chosen.filter(|&index| index < self.objects.len()) {
            self.objects.remove(index);
            self.chosen = self
                .objects
                .len()
                .checked_sub(1)
                .map(|last| index.min(last));
            self.placing = false;
        }
    }

    /// Takes up the objects that a new capture comes with, in place of those there are.
    pub fn take_up(&mut self, placements: &[Placement]) {
        let inserted = |placement: &Placement| Inserted {
            placement: placement.clone(),
        };
        self.objects = placements.iter().map(inserted).collect();
        self.chosen = self.objects.len().checked_sub(1);
        self.placing = false;
        self.dragged = None;
    }

    /// All objects, as the worker is told them.
    pub fn placements(&self) -> Vec<Placement> {
        (self.objects.iter())
            .map(|object| object.placement.clone())
            .collect()
    }

    /// Those that are shown.
    pub fn visible(&self) -> Vec<Placement> {
        let mut visible = self.placements();
        visible.retain(|placement| !placement.hidden);
        visible
    }

    /// Replaces all objects, as undo does.
    pub fn replace(&mut self, objects: Vec<Inserted>) {
        if self.objects == objects {
            return;
        }
        self.objects = objects;
        self.placing = false;
        self.chosen = match (self.chosen, self.objects.len()) {
            (_, 0) => None,
            (chosen, count) => Some(chosen.unwrap_or(count - 1).min(count - 1)),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hidden_objects_are_told_as_such_and_replacing_keeps_a_choice() {
        let mut insertions = Insertions::default();
        insertions.add("chair.glb".into(), Some(DVec3::ZERO));
        insertions.duplicate(DVec3::X);
        assert_eq!(insertions.placements().len(), 2);
        assert_eq!(insertions.placements()[1].at, Some(DVec3::X));
        insertions.objects[0].placement.hidden = true;
        let hidden: Vec<bool> = (insertions.placements().iter())
            .map(|placement| placement.hidden)
            .collect();
        assert_eq!((hidden, insertions.visible().len()), (vec![true, false], 1));
        let mut taken_up = Insertions::default();
        taken_up.take_up(&insertions.placements());
        assert_eq!(taken_up.objects, insertions.objects);
        let before = insertions.objects.clone();
        insertions.delete();
        insertions.delete();
        assert!(insertions.objects.is_empty() && insertions.chosen.is_none());
        insertions.replace(before);
        assert_eq!(
            (insertions.objects.len(), insertions.visible().len()),
            (2, 1)
        );
        assert_eq!(insertions.chosen, Some(1));
    }

    #[test]
    fn objects_are_told_by_their_ending() {
        assert!(is_object(Path::new("a/Chair.OBJ")) && is_object(Path::new("b.glb")));
        assert!(!is_object(Path::new("capture")) && !is_object(Path::new("a.png")));
    }
}
