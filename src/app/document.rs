//! What a person would save or undo: the capture with what the worker says of it, parameters, edits, inserted and
//! regrouped objects, with one history for all that is changed by hand.

use crate::app::insertion::Insertions;
use crate::app::undo::History;
use crate::capture::regroup::Regroup;
use crate::compose::placement::Placement;
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::session::command::Source;
use crate::session::edits::{Edited, Edits, ObjectEdit};
use crate::session::snapshot::{OpenCapture, Phase, Snapshot};
use glam::Vec3;
use std::sync::Arc;

/// What undo and redo go back and forth in.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Step {
    inserted: Vec<Placement>,
    regroups: Vec<Regroup>,
    edits: Edits,
}

#[derive(Default)]
pub struct Document {
    /// The worker's newest snapshot.
    pub snapshot: Arc<Snapshot>,
    pub opening: Option<Source>,
    /// The parameters as edited here.
    pub settings: Settings,
    /// Changes made by hand to the estimate.
    pub edits: Edits,
    /// The estimate with those changes.
    pub estimate: Arc<Estimate>,
    pub insertions: Insertions,
    /// All changes of the capture's objects since it was read.
    pub regroups: Vec<Regroup>,
    /// Steps of what is edited by hand.
    pub history: History<Step>,
    edited: Edited,
}

impl Document {
    /// What is open.
    pub fn capture(&self) -> Option<&Arc<OpenCapture>> {
        self.snapshot.capture.as_ref()
    }

    /// Number of photographs.
    pub fn frames(&self) -> usize {
        self.capture().map_or(0, |open| open.scene.cameras.len())
    }

    /// Why nothing is open, in words.
    pub fn nothing_open(&self) -> &'static str {
        match self.snapshot.phase == Phase::Loading || self.opening.is_some() {
            true => "Reading the capture…",
            false => "No capture is open",
        }
    }

    /// Whether the solver runs, and would be paused by "Run / Pause".
    pub fn is_running(&self) -> bool {
        matches!(self.snapshot.phase, Phase::Solving | Phase::Loading)
    }

    /// The unit of radiance; relative if the photographs have 8 or 16 bits, which leave its scale open.
    pub fn radiance_unit(&self) -> &'static str {
        let relative = |open: &Arc<OpenCapture>| {
            let mut photographs = open.photographs.iter();
            photographs.any(|photograph| photograph.saturation.is_finite())
        };
        match self.capture().is_some_and(relative) {
            true => "relative units",
            false => "W/(sr·m²)",
        }
    }

    /// Whether the worker has regrouped the objects as asked; until then no edit of an object can be made, since edits go
    /// by an object's index.
    pub fn objects_are_current(&self) -> bool {
        let capture = self.capture();
        capture.is_none_or(|open| open.options.objects == self.regroups)
    }

    pub fn can_regroup(&self) -> bool {
        self.capture().is_some() && self.objects_are_current()
    }

    pub fn names(&self, objects: &[u32]) -> Vec<String> {
        let all = (self.capture()).map_or(&[][..], |open| &open.capture.mesh.objects);
        let names = objects.iter().filter_map(|&k| all.get(k as usize));
        names.cloned().collect()
    }

    /// Loads the edits, objects and regroupings that a capture was opened with, and begins a new history.
    pub fn start(&mut self) {
        self.insertions.take_up(&self.snapshot.inserted);
        self.regroups = (self.capture()).map_or_else(Vec::new, |open| open.options.objects.clone());
        self.edits = self.snapshot.edits.clone();
        self.history = History::starting_at(self.step());
    }

    pub fn apply_edits(&mut self) {
        self.estimate = self.edited.of(&self.snapshot.estimate, &self.edits);
    }

    fn step(&self) -> Step {
        Step {
            inserted: self.insertions.objects.clone(),
            regroups: self.regroups.clone(),
            edits: self.edits.clone(),
        }
    }

    /// Records a step where something changed; to be called while no button is down, so that a drag is one step.
    pub fn record(&mut self) {
        self.history.record(&self.step());
    }

    /// Takes the last step back, or makes the last undone step again.
    pub fn undo_or_redo(&mut self, undo: bool) {
        if let Some(step) = self.history.step(&self.step(), undo) {
            self.insertions.replace(step.inserted);
            self.regroups = step.regroups;
            self.edits = step.edits;
        }
    }

    /// Index of an object that the estimate knows.
    pub fn estimated(&self, object: Option<u32>) -> Option<usize> {
        object
            .map(|object| object as usize)
            .filter(|&object| object < self.snapshot.estimate.objects.len())
    }

    /// Whether an object emits light or was switched off.
    pub fn is_lamp(&self, object: usize) -> bool {
        let found = self.estimate.objects.get(object);
        self.edits.object(object).off || found.is_some_and(|found| found.emission != Vec3::ZERO)
    }

    pub fn switch_lamp(&mut self, object: usize) {
        let edit = self.edits.object(object);
        let off = !edit.off;
        self.edits.set(object, ObjectEdit { off, ..edit });
    }
}
