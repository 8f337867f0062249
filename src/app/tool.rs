//! The active tool: what the next click or drag in a view does instead of selecting.

use crate::app::insertion::handles::Handle;
use crate::app::insertion::transform::Transform;
use crate::scene::Scene;
use crate::scene::geometry::{Hit, Ray};
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

/// The active tool.
#[derive(Debug, Clone, Default)]
pub struct Tool {
    /// What the next click is asked for.
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
