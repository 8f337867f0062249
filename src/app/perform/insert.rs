//! Objects that are added: read first, then put on the floor in view.

use crate::app::insertion::transform::Transform;
use crate::app::insertion::{is_object, name};
use crate::app::request::Request;
use crate::app::state::App;
use crate::session::snapshot::Level;
use glam::DVec3;
use std::path::PathBuf;

/// The cosine of the steepest surface that an object is put on.
const LEVEL: f64 = 0.9;

impl App {
    /// Adds an object once its file is read; the pane says why a file cannot be added.
    pub fn insert(&mut self, file: PathBuf) {
        let adding = &mut self.view.panels.adding;
        adding.problem = None;
        if is_object(&file) {
            adding.wanted.push(file);
        } else {
            let problem = "is no object that can be inserted; save it as GLB, glTF or OBJ";
            adding.problem = Some(format!("{}: {problem}", file.display()));
        }
    }

    /// Follows Blender's keys, while they are on and no field takes letters.
    pub(in crate::app) fn transform_by_keys(&mut self, ctx: &egui::Context) {
        let open = self.document.capture().is_some() && !self.shows_start_page();
        if self.preferences.blender_keys && open && !ctx.text_edit_focused() {
            let transform = &mut self.view.tool.transform;
            let taken_back = Transform::follow_keys(transform, &self.document.insertions, ctx);
            if let Some((index, before)) = taken_back {
                self.perform(Request::Place(index, before), ctx);
            }
        }
    }

    /// Where an added object is put first: on the lowest level surface of the shown view, near the picture's middle.
    fn free_place(&self) -> Option<DVec3> {
        let scene = &self.document.capture()?.scene;
        let up = scene.up.as_dvec3();
        let columns = [0.5, 0.4, 0.6, 0.3, 0.7];
        let rows = (0..9).map(|row| 0.55 + 0.05 * row as f32);
        let places = rows.flat_map(|y| columns.map(|x| egui::pos2(x, y)));
        let surface_at = |at| self.view.shown.surface_at(&self.document, at);
        let seen: Vec<_> = places.filter_map(surface_at).collect();
        let level = seen.iter().filter(|at| at.normal.dot(up) > LEVEL);
        // The lowest of them is the floor, within a step of the scene's size.
        let step = f64::from(scene.diameter) * 0.01;
        let lowest = (level.clone().map(|at| at.point.dot(up))).fold(f64::INFINITY, f64::min);
        let floor = level.clone().find(|at| at.point.dot(up) < lowest + step);
        floor.or(seen.first()).map(|at| at.point)
    }

    /// Adds the objects whose files have been read, scaled down if larger than the scene.
    pub(in crate::app) fn take_models(&mut self, ctx: &egui::Context) {
        let Some(capture) = self.document.capture().cloned() else {
            return;
        };
        let (adding, insertions) = (&mut self.view.panels.adding, &mut self.document.insertions);
        for (file, read) in insertions.models.update(ctx, &insertions.objects) {
            // For objects inserted before, the worker reports the error and removes them.
            if let Err(why) = read
                && adding.wanted.contains(&file)
            {
                adding.wanted.retain(|wanted| *wanted != file);
                adding.problem = Some(why);
            }
        }
        let is_read = |file: &mut PathBuf| insertions.models.ask(ctx, file);
        let ready: Vec<_> = adding.wanted.extract_if(.., is_read).collect();
        for file in ready {
            let at = self.free_place();
            let insertions = &mut self.document.insertions;
            let scale = insertions.models.fitting_scale(&file, &capture.scene);
            insertions.add(file, at, scale.unwrap_or(1.0));
            self.view.tool.placing = true;
            if let Some((scale, (_, object))) = scale.zip(insertions.chosen()) {
                let name = name(object);
                let message =
                    format!("{name} is larger than the scene, so it was scaled by {scale}");
                self.say(Level::Info, message);
            }
        }
    }
}
