//! Everything that is edited by hand, with one history for all of it.

use crate::app::insertion::Inserted;
use crate::app::state::App;
use crate::app::undo::History;
use crate::capture::regroup::Regroup;
use crate::session::command::Command;
use crate::session::edits::{Edits, ObjectEdit};
use glam::Vec3;

/// What undo and redo go back and forth in.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Document {
    inserted: Vec<Inserted>,
    objects: Vec<Regroup>,
    edits: Edits,
}

impl App {
    fn document(&self) -> Document {
        Document {
            inserted: self.insertions.objects.clone(),
            objects: self.grouping.changes.clone(),
            edits: self.edits.clone(),
        }
    }

    fn restore(&mut self, document: Document) {
        self.insertions.replace(document.inserted);
        self.grouping.changes = document.objects;
        self.edits = document.edits;
    }

    /// Records a step where something changed; to be called while no button is down, so that a drag is one step.
    pub fn settle(&mut self) {
        let document = self.document();
        self.history.settle(&document);
    }

    /// Takes the last step back.
    pub fn undo(&mut self) {
        let mut document = self.document();
        if self.history.undo(&mut document) {
            self.restore(document);
        }
    }

    /// Makes the last undone step again.
    pub fn redo(&mut self) {
        let mut document = self.document();
        if self.history.redo(&mut document) {
            self.restore(document);
        }
    }

    /// Hands the worker the changes to the estimate where they differ from those it has.
    pub fn send_edits(&mut self) {
        if self.edits != self.sent_edits && self.connect(Command::Edit(self.edits.clone())) {
            self.sent_edits = self.edits.clone();
        }
        self.estimate = self.edited.of(&self.snapshot.estimate, &self.edits);
    }

    /// Takes up the changes that the worker's capture came with.
    pub fn take_edits(&mut self) {
        self.edits = self.snapshot.edits.clone();
        self.sent_edits = self.edits.clone();
        self.history = History::starting_at(self.document());
    }

    /// The selected object, where something is known of it.
    fn selected_object(&self) -> Option<usize> {
        let object = self.selected? as usize;
        (object < self.snapshot.estimate.objects.len()).then_some(object)
    }

    /// Whether the selected object emits light or was switched off.
    pub fn can_switch_lamp(&self) -> bool {
        self.selected_object().is_some_and(|object| {
            let lit = (self.estimate.objects.get(object))
                .is_some_and(|found| found.emission != Vec3::ZERO);
            self.edits.object(object).off || lit
        })
    }

    /// Whether the selected object was changed.
    pub fn can_reset_material(&self) -> bool {
        let object = self.selected_object();
        object.is_some_and(|object| self.edits.object(object) != ObjectEdit::default())
    }

    /// Switches the selected lamp off, or on again.
    pub fn switch_lamp(&mut self) {
        if let Some(object) = self.selected_object() {
            let mut edit = self.edits.object(object);
            edit.off = !edit.off;
            self.edits.set(object, edit);
        }
    }

    /// Puts the selected object back to what was found.
    pub fn reset_material(&mut self) {
        if let Some(object) = self.selected_object() {
            self.edits.set(object, ObjectEdit::default());
        }
    }
}
