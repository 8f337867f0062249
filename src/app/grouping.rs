//! Which faces are one object, changed by hand: objects joined, named anew, and cut out.

use crate::app::state::App;
use crate::capture::mesh::Mesh;
use crate::capture::regroup::{Regroup, regroup, same_objects};
use crate::session::command::{Command, Regrouping};
use crate::session::snapshot::{Level, OpenCapture, Snapshot};
use std::collections::BTreeSet;

/// The changes of the capture's objects, and what more of them is made with.
#[derive(Debug, Default)]
pub struct Grouping {
    /// All changes since the capture was read.
    pub changes: Vec<Regroup>,
    /// Objects chosen besides the selected one.
    pub also: BTreeSet<u32>,
    /// The selected object and its name as typed.
    pub name: (Option<u32>, String),
    /// Whether the field of the name is to be typed into.
    pub naming: bool,
    sent: Vec<Regroup>,
}

impl Grouping {
    /// With the changes that a capture was read with.
    pub fn of(capture: Option<&OpenCapture>) -> Self {
        let changes = capture.map_or_else(Vec::new, |capture| capture.options.objects.clone());
        Self {
            sent: changes.clone(),
            changes,
            ..Self::default()
        }
    }
}

impl App {
    /// Whether the objects that are shown are those that were asked for; until then nothing can be changed that goes by an
    /// object's place.
    pub fn is_steady(&self) -> bool {
        let capture = self.capture();
        capture.is_none_or(|capture| capture.options.objects == self.grouping.changes)
    }

    /// Whether objects can be changed.
    pub fn can_regroup(&self) -> bool {
        self.capture().is_some() && self.is_steady()
    }

    /// Takes in what a snapshot says of objects asked for; whether it brought the open capture with them.
    pub(super) fn take_grouping(&mut self, before: &Snapshot) -> bool {
        let Some(now) = self.snapshot.capture.clone() else {
            return false;
        };
        if self.snapshot.regroupings == before.regroupings {
            return false;
        }
        let changed = before.capture.as_ref().is_some_and(|before| {
            before.hash == now.hash && before.options.objects != now.options.objects
        });
        let wanted = &self.grouping.changes;
        if !changed && *wanted == self.grouping.sent && *wanted != now.options.objects {
            // The capture could not be read again: what is open stays as it is.
            self.grouping = Grouping::of(Some(&now));
            self.edits = self.snapshot.edits.clone();
            self.sent_edits = self.edits.clone();
        }
        if changed {
            self.objects_changed();
        }
        changed
    }

    /// Takes in the capture that was open with other objects: what is looked at and all steps of editing stay.
    fn objects_changed(&mut self) {
        self.selected = None;
        self.grouping.also.clear();
        self.grouping.name = (None, String::new());
        self.grouping.naming = false;
        self.picking = None;
        self.sent_view = None;
        self.sent_edits = self.snapshot.edits.clone();
        self.sent_insertions = self.snapshot.inserted.to_vec();
        self.model.remake();
        self.trade_of_capture();
    }

    /// The selected object and those chosen besides, the selected one first.
    pub fn chosen_objects(&self) -> Vec<u32> {
        let also = self.grouping.also.iter().copied();
        let also = also.filter(|&object| Some(object) != self.selected);
        self.selected.into_iter().chain(also).collect()
    }

    /// Selects an object alone, or where `more`, chooses it besides those chosen before, or no longer.
    pub fn choose(&mut self, object: Option<u32>, more: bool) {
        match (object, self.selected) {
            (Some(object), Some(selected)) if more && object != selected => {
                if !self.grouping.also.remove(&object) {
                    self.grouping.also.insert(object);
                }
            }
            _ if more && object.is_none() => {}
            _ => {
                self.grouping.also.clear();
                self.selected = object;
            }
        }
    }

    /// Makes one object of those that are chosen.
    pub fn join_objects(&mut self) {
        let objects = self.names(&self.chosen_objects());
        self.change_objects(Regroup::Join { objects });
    }

    /// Gives an object another name.
    pub fn rename_object(&mut self, object: u32, name: &str) {
        let name = name.trim().to_owned();
        if let Some(object) = self.names(&[object]).pop().filter(|old| *old != name) {
            self.change_objects(Regroup::Rename { object, name });
        }
    }

    /// Makes faces, in ascending order, an object of their own.
    pub fn cut_out(&mut self, faces: Vec<u32>) {
        let Some(capture) = self.capture().filter(|_| !faces.is_empty()) else {
            let message = "no face that is seen lies inside the line; nothing was cut out";
            self.notices.say(Level::Info, message);
            return;
        };
        let taken = &capture.capture.mesh.objects;
        let name = (1..)
            .map(|number| format!("cut {number}"))
            .find(|name| !taken.contains(name))
            .unwrap_or_default();
        self.change_objects(Regroup::cut(faces, name));
    }

    fn names(&self, objects: &[u32]) -> Vec<String> {
        let Some(capture) = self.capture() else {
            return Vec::new();
        };
        let all = &capture.capture.mesh.objects;
        let names = objects.iter().filter_map(|&k| all.get(k as usize));
        names.cloned().collect()
    }

    /// Adds a change, where it can be made; what was changed of other objects stays with them.
    fn change_objects(&mut self, change: Regroup) {
        let Some(capture) = self.capture().filter(|_| self.can_regroup()) else {
            return;
        };
        let before = &capture.capture.mesh;
        let mut after = Mesh {
            objects: before.objects.clone(),
            object_of: before.object_of.clone(),
            ..Mesh::default()
        };
        match regroup(&mut after, std::slice::from_ref(&change)) {
            Err(error) => self.notices.say(Level::Warning, error.to_string()),
            Ok(()) => {
                let same = same_objects(&before.object_of, &after.object_of, before.objects.len());
                self.edits = self.edits.moved(&same);
                self.grouping.changes.push(change);
            }
        }
    }

    /// Hands the worker the changes of objects where they differ from those it has.
    pub(super) fn send_grouping(&mut self) {
        let changes = &self.grouping.changes;
        let Some(capture) = self.capture().filter(|_| *changes != self.grouping.sent) else {
            return;
        };
        let wanted = Regrouping {
            hash: capture.hash.clone(),
            changes: changes.clone(),
            edits: self.edits.clone(),
        };
        if self.connect(Command::Regroup(Box::new(wanted))) {
            self.grouping.sent.clone_from(&self.grouping.changes);
            self.sent_edits = self.edits.clone();
        }
    }
}
