//! The active tool: what the next click or drag in a view does instead of selecting.

use crate::app::insertion::Insertions;
use crate::app::insertion::handles::Handle;
use crate::app::insertion::transform::Transform;
use crate::compose::placement::Placement;
use crate::scene::Scene;
use crate::scene::geometry::{Hit, Ray};
use egui::{Pos2, Response};
use glam::{DVec3, Vec3};

/// What the next click is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pick {
    /// The place whose light is written as a panorama.
    Probe,
    /// The ends of a known length, of which the first may be there.
    Length(Option<DVec3>),
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

#[derive(Debug, Clone, Default)]
pub struct Tool {
    pub pick: Option<Pick>,
    /// Whether the next click places the chosen inserted object.
    pub placing: bool,
    /// The handle of an inserted object that is being dragged.
    pub dragged: Option<Handle>,
    /// What the pointer does to the chosen inserted object until a click.
    pub transform: Option<Transform>,
}

impl Tool {
    /// Asks for a click.
    pub fn pick(&mut self, pick: Pick) {
        self.placing = false;
        self.pick = Some(pick);
    }

    /// Whether the next click does something else than select.
    pub fn is_active(&self) -> bool {
        self.placing || self.dragged.is_some() || self.pick.is_some() || self.transform.is_some()
    }

    /// Follows the pointer over a view of the scene: whether it has hold of an inserted object, and where that is put. A drag that
    /// `started` may take a handle. `project` maps to the screen; `aim` gives a point's ray and the surface that it meets.
    pub fn follow(
        &mut self,
        response: &Response,
        started: bool,
        insertions: &Insertions,
        scene: &Scene,
        project: impl Fn(Vec3) -> Option<Pos2>,
        aim: impl Fn(Pos2) -> (Ray, Option<DVec3>),
    ) -> (bool, Option<(usize, Placement)>) {
        let press = response.ctx.input(|input| input.pointer.press_origin());
        if let Some(press) = press.filter(|_| started) {
            self.dragged = insertions.handle_at(scene, press, &project);
        }
        if response.drag_stopped() {
            self.dragged = None;
        }
        if let Some((pointer, transform)) = response.hover_pos().zip(self.transform.as_mut()) {
            let (ray, surface) = aim(pointer);
            let placed = transform.placed(scene, pointer, &ray, surface, project);
            return (true, placed);
        }
        let pointer = (response.interact_pointer_pos()).filter(|_| response.dragged());
        let Some((pointer, handle)) = pointer.zip(self.dragged) else {
            return (false, None);
        };
        let (ray, surface) = aim(pointer);
        let modifiers = response.ctx.input(|input| input.modifiers);
        let placed = insertions.dragged(handle, scene, &ray, surface, modifiers);
        (true, placed)
    }
}

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
        let normal = scene.normals.get(triangle)?.as_dvec3();
        let behind = normal.dot(ray.direction.as_dvec3()) > 0.0;
        Some(Self {
            point: scene.point(hit).as_dvec3() + scene.origin,
            normal: if behind { -normal } else { normal },
            object: *scene.object_of.get(triangle)?,
        })
    }
}
