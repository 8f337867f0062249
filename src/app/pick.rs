//! What a click in a view does: what was asked for beforehand, else placing, else selecting.

use crate::app::shell::files::Sheet;
use crate::app::state::App;
use crate::scene::Scene;
use crate::scene::geometry::{Hit, Ray};
use crate::session::command::Command;
use egui::Pos2;
use glam::DVec3;

/// What the next click is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pick {
    /// The place whose light is written as a panorama.
    Probe,
    /// The ends of a known length, of which the first may be there.
    Length(Option<DVec3>),
    /// A surface that is the ground.
    Ground,
    /// Faces that become an object of their own, by a line around them.
    Lasso,
}

impl Pick {
    /// What a person is to do.
    pub fn prompt(self) -> &'static str {
        match self {
            Self::Probe => "Click where the light is to be taken",
            Self::Length(None) => "Click one end of a length that you know",
            Self::Length(Some(_)) => "Click its other end",
            Self::Ground => "Click the ground",
            Self::Lasso => "Draw around faces in the 3D view to cut them out",
        }
    }
}

/// Distance of a probe from the surface that was clicked, as a fraction of the scene's diameter.
const OFF_SURFACE: f64 = 0.01;

/// A point of a surface in a view.
#[derive(Debug, Clone, Copy)]
pub struct Clicked {
    /// In the capture's coordinates.
    pub point: DVec3,
    /// Unit normal towards the viewer.
    pub normal: DVec3,
    /// The scene's object.
    pub object: u32,
}

impl Clicked {
    /// The point of a hit of the scene along a ray.
    pub fn new(scene: &Scene, ray: &Ray, hit: &Hit) -> Option<Self> {
        let triangle = hit.triangle as usize;
        let normal = *scene.normals.get(triangle)?;
        let side = if normal.dot(ray.direction) > 0.0 {
            -1.0
        } else {
            1.0
        };
        Some(Self {
            point: scene.point(hit).as_dvec3() + scene.origin,
            normal: (normal * side).as_dvec3(),
            object: *scene.object_of.get(triangle)?,
        })
    }
}

impl App {
    /// The surface at a point of the shown view, given in fractions of its size.
    pub fn surface_at(&self, at: Pos2) -> Option<Clicked> {
        let scene = &self.capture()?.scene;
        let camera = self.camera()?;
        let k = &camera.intrinsics;
        let ray = camera.ray(glam::vec2(at.x * k.width as f32, at.y * k.height as f32));
        Clicked::new(scene, &ray, &scene.intersect(&ray)?)
    }

    /// Does what a click on a surface, or past all of them, is for; `more` chooses objects besides those chosen before.
    pub fn clicked(&mut self, clicked: Option<Clicked>, more: bool) {
        let Some(clicked) = clicked else {
            self.choose(None, more);
            return;
        };
        if let Some(pick) = self.picking.take() {
            self.picked(pick, clicked);
        } else if self.insertions.placing && self.insertions.place(clicked.point) {
            self.insertions.placing = false;
        } else {
            self.select(Some(clicked.object), more);
        }
    }

    /// Asks for a click.
    pub fn pick(&mut self, pick: Pick) {
        self.insertions.placing = false;
        self.picking = Some(pick);
    }

    fn picked(&mut self, pick: Pick, clicked: Clicked) {
        let Some(capture) = self.capture().cloned() else {
            return;
        };
        match pick {
            // A click encloses nothing.
            Pick::Lasso => self.pick(Pick::Lasso),
            Pick::Probe => {
                let off = f64::from(capture.scene.diameter) * OFF_SURFACE;
                self.sheet = Sheet::probe(&capture.name, clicked.point + clicked.normal * off);
            }
            Pick::Length(None) => self.pick(Pick::Length(Some(clicked.point))),
            Pick::Length(Some(first)) => {
                let found = first.distance(clicked.point);
                if found > 0.0 {
                    self.sheet = Sheet::Length {
                        found,
                        metres: found,
                    };
                }
            }
            Pick::Ground => {
                let (mut options, up) = (capture.options.clone(), clicked.normal);
                let of_files = options.coordinates.undo(clicked.point, capture.capture.up);
                options.up = Some(up);
                options.coordinates.ground = Some(of_files.dot(up));
                self.send(Command::Reframe(Box::new(options)));
            }
        }
    }

    /// Makes a length that is `found` in the capture's coordinates so many metres.
    pub fn set_length(&mut self, found: f64, metres: f64) {
        if let Some(capture) = self.capture() {
            let mut options = capture.options.clone();
            let scale = options.coordinates.scale.unwrap_or(1.0);
            options.coordinates.scale = Some(scale * metres / found);
            self.send(Command::Reframe(Box::new(options)));
        }
    }

    /// Whether the next click does something else than select.
    pub fn aims(&self) -> bool {
        self.insertions.placing || self.insertions.dragged.is_some() || self.picking.is_some()
    }
}
