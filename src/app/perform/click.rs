//! What a click in a view does: it answers a pick, places an object, or selects.

use crate::app::shell::sheet::{PROBE, Sheet};
use crate::app::state::App;
use crate::app::tool::{Clicked, Pick};
use crate::session::command::{Command, OpenOptions};

/// Distance of a probe from the surface that was clicked, as a fraction of the scene's diameter.
const OFF_SURFACE: f64 = 0.01;

impl App {
    /// Handles a click on a surface, or past all of them; `more` adds to the selection.
    pub(super) fn clicked(&mut self, clicked: Option<Clicked>, more: bool) {
        let Some(clicked) = clicked else {
            self.view.selection.select(None, more);
            return;
        };
        let chosen = self.document.insertions.chosen();
        let placed = chosen.filter(|_| self.view.tool.placing);
        let placed = placed.map(|(index, _)| index);
        if let Some(pick) = self.view.tool.pick.take() {
            self.picked(pick, clicked);
        } else if let Some(index) = placed {
            self.document.insertions.objects[index].at = Some(clicked.point);
            self.view.tool.placing = false;
        } else {
            self.view.selection.select(Some(clicked.object), more);
            self.view.panels.objects.reveal = true;
        }
    }

    fn picked(&mut self, pick: Pick, clicked: Clicked) {
        let Some(capture) = self.document.capture().cloned() else {
            return;
        };
        match pick {
            // A click encloses nothing.
            Pick::Lasso => self.view.tool.pick(Pick::Lasso),
            Pick::Probe => {
                let off = f64::from(capture.scene.diameter) * OFF_SURFACE;
                let at = clicked.point + clicked.normal * off;
                self.view.shell.sheet = Sheet::export(&capture.name, PROBE, at);
            }
            Pick::Length(None) => self.view.tool.pick(Pick::Length(Some(clicked.point))),
            Pick::Length(Some(first)) => {
                let [found, metres] = [first.distance(clicked.point); 2];
                if found > 0.0 {
                    self.view.shell.sheet = Sheet::Length { found, metres };
                }
            }
            Pick::Ground => self.reframe(|options| {
                let up = clicked.normal;
                let of_files = options.coordinates.undo(clicked.point, capture.capture.up);
                options.up = Some(up);
                options.coordinates.ground = Some(of_files.dot(up));
            }),
        }
    }

    /// Makes a length that is `found` in the capture's coordinates so many metres.
    pub(super) fn set_length(&mut self, found: f64, metres: f64) {
        self.reframe(|options| {
            let scale = options.coordinates.scale.unwrap_or(1.0);
            options.coordinates.scale = Some(scale * metres / found);
        });
    }

    /// Reads the capture again with other options.
    fn reframe(&mut self, change: impl FnOnce(&mut OpenOptions)) {
        if let Some(capture) = self.document.capture() {
            let mut options = capture.options.clone();
            change(&mut options);
            self.send(Command::Reframe(Box::new(options)));
        }
    }
}
