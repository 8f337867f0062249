//! The built-in room: our own geometry, lights and materials, with photographs of them and the truth. And rooms like
//! it, furnished at random.
//!
//! Everything but the photographs is computed at start-up. The photographs are this room's own path-traced
//! renderings, kept in `assets/room` so that the program starts at once; `relit demo --render` makes them again.

pub mod build;
pub mod cameras;
mod furniture;
pub mod generated;
pub mod photographs;
pub mod shape;
mod texture;
pub mod truth;
mod write;

pub use write::write;

use crate::capture::mesh::Mesh;
use crate::capture::photograph::{Photograph, PhotographSource};
use crate::capture::truth::Truth;
use crate::capture::{Capture, Frame};
use crate::error::Result;
use crate::scene::Scene;
use crate::transport::lit::Lit;
use crate::transport::material::Material;
use cameras::View;
use glam::DVec3;
use photographs::Rendering;
use std::sync::Arc;

/// Geometry and truth of a room, before any photograph.
#[derive(Debug, Clone)]
pub struct Room {
    /// The name shown to people.
    pub name: String,
    /// Triangles in named objects, each object closed or facing the room.
    pub mesh: Mesh,
    /// The true material of each object.
    pub materials: Vec<Material>,
    /// From where it is photographed.
    pub views: Vec<View>,
}

impl Room {
    /// Builds the built-in room.
    pub fn new() -> Self {
        let (mesh, materials) = build::build();
        Self {
            name: "built-in room".to_owned(),
            mesh,
            materials,
            views: cameras::built_in(),
        }
    }

    /// The room as a capture with the given photographs, one a camera and all of one size.
    pub fn capture(&self, photographs: Vec<PhotographSource>, size: [u32; 2]) -> Capture {
        let cameras = cameras::cameras(&self.views, size);
        let up: DVec3 = cameras.iter().map(|(_, pose)| pose.rotation.y_axis).sum();
        Capture {
            name: self.name.clone(),
            folder: None,
            segmentation: None,
            mesh: self.mesh.clone(),
            frames: cameras
                .into_iter()
                .zip(photographs)
                .map(|((intrinsics, pose), photograph)| Frame {
                    intrinsics,
                    pose,
                    exposure: None,
                    photograph,
                    depth: None,
                })
                .collect(),
            up: up.normalize_or_zero(),
            warnings: Vec::new(),
        }
    }

    /// The room as a scene with its true materials, seen by its cameras at a size in pixels.
    ///
    /// # Errors
    /// Never for the room as it is; the signature is the scene's.
    pub fn lit(&self, size: [u32; 2]) -> Result<Lit> {
        let dark = photographs::black(size);
        let sources = vec![PhotographSource::Memory(dark); self.views.len()];
        let scene = Scene::new(&self.capture(sources, size))?;
        Ok(Lit::new(Arc::new(scene), self.materials.clone(), None))
    }

    /// What is true of it.
    ///
    /// # Errors
    /// As [`Room::lit`].
    pub fn truth(&self, size: [u32; 2]) -> Result<Truth> {
        let objects = truth::objects(&self.lit(size)?);
        Ok(Truth {
            objects: objects.into_iter().map(|(n, o)| (n, o.into())).collect(),
        })
    }

    /// The room with the photographs kept in the program.
    ///
    /// # Errors
    /// The program file is damaged.
    pub fn kept(&self) -> Result<Capture> {
        Ok(self.capture_of(photographs::kept()?, photographs::KEPT.size))
    }

    /// The room photographed anew.
    ///
    /// # Errors
    /// As [`Room::lit`].
    pub fn photographed(&self, rendering: &Rendering) -> Result<Capture> {
        Ok(self.capture_of(photographs::render(self, rendering)?, rendering.size))
    }

    /// The room as a capture with photographs in memory, one a camera and all of one size.
    pub fn capture_of(&self, photographs: Vec<Photograph>, size: [u32; 2]) -> Capture {
        let sources = photographs
            .into_iter()
            .map(|photograph| PhotographSource::Memory(Arc::new(photograph)))
            .collect();
        self.capture(sources, size)
    }
}

/// The built-in room as a capture, ready to solve.
///
/// # Errors
/// The program file is damaged.
pub fn capture() -> Result<Capture> {
    Room::new().kept()
}

impl Default for Room {
    fn default() -> Self {
        Self::new()
    }
}
