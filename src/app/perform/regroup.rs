//! Which faces are one object, changed by hand: objects joined, renamed, and cut out.

use crate::app::state::App;
use crate::capture::mesh::Mesh;
use crate::capture::regroup::{Regroup, regroup, same_objects};
use crate::session::snapshot::{Level, Snapshot};

impl App {
    /// Follows the worker's answer to a regrouping; true if the snapshot brought the regrouped capture.
    pub(in crate::app) fn take_regrouped(&mut self, before: &Snapshot) -> bool {
        let snapshot = self.document.snapshot.clone();
        let Some(now) = &snapshot.capture else {
            return false;
        };
        if snapshot.regroupings == before.regroupings {
            return false;
        }
        let regrouped = before.capture.as_ref().is_some_and(|before| {
            before.hash == now.hash && before.options.objects != now.options.objects
        });
        let (document, sent) = (&mut self.document, &mut self.jobs.worker.sent);
        let refused =
            document.regroups == sent.regroups && document.regroups != now.options.objects;
        if regrouped {
            // What is looked at and all steps of editing stay.
            sent.view = None;
            sent.edits = snapshot.edits.clone();
            sent.insertions = snapshot.inserted.to_vec();
            self.view.selection.select(None, false);
            self.view.panels.objects.renamed = None;
            self.view.panels.objects.naming = false;
            self.view.tool.pick = None;
            self.view.model.remake();
            self.trade_of_capture();
        } else if refused {
            // The worker could not regroup: the objects stay as they are.
            document.regroups.clone_from(&now.options.objects);
            sent.regroups.clone_from(&now.options.objects);
            document.edits = snapshot.edits.clone();
            sent.edits = snapshot.edits.clone();
        }
        regrouped
    }

    pub(super) fn join_objects(&mut self) {
        let objects = self.document.names(&self.view.selection.all());
        self.regroup(Regroup::Join { objects });
    }

    pub(super) fn rename_object(&mut self, object: u32, name: &str) {
        let name = name.trim().to_owned();
        let old = self.document.names(&[object]).pop();
        if let Some(object) = old.filter(|old| *old != name) {
            self.regroup(Regroup::Rename { object, name });
        }
    }

    /// Makes faces, in ascending order, an object of their own.
    pub(super) fn cut_out(&mut self, faces: Vec<u32>) {
        let Some(capture) = self.document.capture().filter(|_| !faces.is_empty()) else {
            let message = "no face that is seen lies inside the line; nothing was cut out";
            return self.say(Level::Info, message);
        };
        let taken = &capture.capture.mesh.objects;
        let mut names = (1..).map(|number| format!("cut {number}"));
        let name = names.find(|name| !taken.contains(name));
        self.regroup(Regroup::cut(faces, name.unwrap_or_default()));
    }

    /// Adds a change, where it can be made; edits of other objects stay with them.
    fn regroup(&mut self, change: Regroup) {
        let document = &mut self.document;
        if !document.can_regroup() {
            return;
        }
        let Some(capture) = document.capture() else {
            return;
        };
        let before = &capture.capture.mesh;
        let mut after = Mesh {
            objects: before.objects.clone(),
            object_of: before.object_of.clone(),
            ..Mesh::default()
        };
        match regroup(&mut after, std::slice::from_ref(&change)) {
            Err(error) => self.say(Level::Warning, error.to_string()),
            Ok(()) => {
                let same = same_objects(&before.object_of, &after.object_of, before.objects.len());
                document.edits = document.edits.moved(&same);
                document.regroups.push(change);
            }
        }
    }
}
