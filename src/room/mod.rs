//! The built-in room: our own geometry, lights and materials, with photographs of them and the truth.
//!
//! Everything but the photographs is computed at start-up. The photographs are this room's own path-traced
//! renderings, kept in `assets/room` so that the program starts at once; `relit demo --render` makes them again.

pub mod build;
pub mod cameras;
mod furniture;
pub mod photographs;
pub mod shape;
mod texture;
pub mod truth;
mod write;

pub use write::write;

use crate::capture::mesh::Mesh;
use crate::capture::photograph::PhotographSource;
use crate::capture::{Capture, Frame};
use crate::error::Result;
use crate::scene::Scene;
use crate::transport::lit::Lit;
use crate::transport::material::Material;
use glam::DVec3;
use photographs::Rendering;
use std::sync::Arc;

/// Geometry and truth of the room, before any photograph.
#[derive(Debug, Clone)]
pub struct Room {
    /// Triangles in named objects, each object closed or facing the room.
    pub mesh: Mesh,
    /// The true material of each object.
    pub materials: Vec<Material>,
}

impl Room {
    /// Builds the room.
    pub fn new() -> Self {
        let (mesh, materials) = build::build();
        Self { mesh, materials }
    }

    /// The room as a capture with the given photographs, one a camera and all of one size.
    pub fn capture(&self, photographs: Vec<PhotographSource>, size: [u32; 2]) -> Capture {
        let cameras = cameras::cameras(size);
        let up: DVec3 = cameras.iter().map(|(_, pose)| pose.rotation.y_axis).sum();
        Capture {
            name: "built-in room".to_owned(),
            folder: None,
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
        let sources = vec![PhotographSource::Memory(dark); cameras::cameras(size).len()];
        let scene = Scene::new(&self.capture(sources, size))?;
        Ok(Lit::new(Arc::new(scene), self.materials.clone(), None))
    }

    /// The room with the photographs kept in the program.
    ///
    /// # Errors
    /// The program file is damaged.
    pub fn kept(&self) -> Result<Capture> {
        let sources = photographs::kept()?
            .into_iter()
            .map(|photograph| PhotographSource::Memory(Arc::new(photograph)))
            .collect();
        Ok(self.capture(sources, photographs::KEPT.size))
    }

    /// The room photographed anew.
    ///
    /// # Errors
    /// As [`Room::lit`].
    pub fn photographed(&self, rendering: &Rendering) -> Result<Capture> {
        let photographs = photographs::render(self, rendering)?;
        let sources = photographs
            .into_iter()
            .map(|photograph| PhotographSource::Memory(Arc::new(photograph)))
            .collect();
        Ok(self.capture(sources, rendering.size))
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
