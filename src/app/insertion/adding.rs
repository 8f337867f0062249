//! Objects that are added: read first, then put on the floor in view.

use crate::app::insertion::is_object;
use crate::app::state::App;
use crate::session::snapshot::Level;
use glam::DVec3;
use std::path::PathBuf;

/// The cosine of the steepest surface that an object is put on.
const LEVEL: f64 = 0.9;

impl App {
    /// Adds an object once its file is read; one that cannot be read is said and joins nothing.
    pub fn insert(&mut self, file: PathBuf) {
        self.insertions.trouble = None;
        if is_object(&file) {
            self.insertions.wanted.push(file);
        } else {
            let problem = "is no object that can be inserted; save it as GLB, glTF or OBJ";
            self.insertions.trouble = Some(format!("{}: {problem}", file.display()));
        }
    }

    /// Where an added object stands at first: on what lies level in the shown view, as near to its middle as can be.
    fn free_place(&self) -> Option<DVec3> {
        let up = self.capture()?.scene.up.as_dvec3();
        let columns = [0.5, 0.4, 0.6, 0.3, 0.7];
        let rows = (0..9).map(|row| 0.55 + 0.05 * row as f32);
        let places = rows.flat_map(|y| columns.map(|x| egui::pos2(x, y)));
        let seen: Vec<_> = places.filter_map(|at| self.surface_at(at)).collect();
        let level = seen.iter().filter(|at| at.normal.dot(up) > LEVEL);
        // The lowest of them is the floor, within a step of the scene's size.
        let step = f64::from(self.capture()?.scene.diameter) * 0.01;
        let lowest = (level.clone().map(|at| at.point.dot(up))).fold(f64::INFINITY, f64::min);
        let floor = level.clone().find(|at| at.point.dot(up) < lowest + step);
        floor.or(seen.first()).map(|at| at.point)
    }

    /// Takes in the shapes of objects' files: those that were waited for join, scaled down where larger than the scene.
    pub(in crate::app) fn take_models(&mut self, ctx: &egui::Context) {
        let Some(capture) = self.capture().cloned() else {
            return;
        };
        let insertions = &mut self.insertions;
        let mut ready: Vec<PathBuf> = Vec::new();
        for (file, read) in insertions.models.update(ctx, &insertions.objects) {
            match read {
                Ok(()) => {}
                Err(why) if insertions.wanted.contains(&file) => {
                    insertions.wanted.retain(|wanted| *wanted != file);
                    insertions.trouble = Some(why);
                }
                // The worker says why, and takes it away.
                Err(_) => {}
            }
        }
        let wanted = std::mem::take(&mut insertions.wanted);
        for file in wanted {
            match insertions.models.ask(ctx, &file) {
                true => ready.push(file),
                false => insertions.wanted.push(file),
            }
        }
        for file in ready {
            let at = self.free_place();
            self.insertions.add(file.clone(), at);
            let scale = self.insertions.models.fitting_scale(&file, &capture.scene);
            if let Some((scale, object)) = scale.zip(self.insertions.chosen()) {
                object.placement.scale = scale;
                let name = object.name();
                let message =
                    format!("{name} is larger than the scene, so it was scaled by {scale}");
                self.notices.say(Level::Info, message);
            }
        }
    }
}
