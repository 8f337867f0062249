//! A room before it is photographed.

use crate::capture::mesh::Mesh;
use crate::capture::photograph::{Encoding, Photograph, PhotographSource};
use crate::capture::truth::Truth;
use crate::capture::{Capture, Frame};
use crate::error::Result;
use crate::room::build;
use crate::room::cameras::{self, View};
use crate::room::truth;
use crate::scene::Scene;
use crate::transport::lit::LitScene;
use crate::transport::material::Material;
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// A room's geometry, materials and views.
#[derive(Debug, Clone)]
pub struct Room {
    /// Display name.
    pub name: String,
    /// Triangles in named objects; each object is closed or faces the room.
    pub mesh: Mesh,
    /// The true material of each object.
    pub materials: Vec<Material>,
    /// Views of its photographs.
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
            views: View::all(&cameras::VIEWS),
        }
    }

    /// The room as a capture, with one photograph a view, all of one size.
    pub fn capture(&self, photographs: Vec<PhotographSource>, size: [u32; 2]) -> Capture {
        let cameras = cameras::cameras(&self.views, size);
        let up: DVec3 = cameras.iter().map(|(_, pose)| pose.rotation.y_axis).sum();
        let frame = |((intrinsics, pose), photograph)| Frame {
            intrinsics,
            pose,
            exposure: None,
            photograph,
            depth: None,
        };
        Capture {
            name: self.name.clone(),
            folder: None,
            segmentation: None,
            mesh: self.mesh.clone(),
            frames: cameras.into_iter().zip(photographs).map(frame).collect(),
            up: up.normalize_or_zero(),
            warnings: Vec::new(),
        }
    }

    /// The room as a lit scene with its true materials, and cameras of a size in pixels.
    ///
    /// # Errors
    /// Only if the room's mesh were invalid.
    pub fn lit(&self, size: [u32; 2]) -> Result<LitScene> {
        let pixels = vec![Vec3::ZERO; size[0] as usize * size[1] as usize];
        let black = Arc::new(linear_photograph(size, pixels));
        let sources = vec![PhotographSource::Memory(black); self.views.len()];
        let scene = Scene::new(&self.capture(sources, size))?;
        Ok(LitScene::new(Arc::new(scene), self.materials.clone(), None))
    }

    /// The truth of each object.
    ///
    /// # Errors
    /// As [`Room::lit`].
    pub fn truth(&self, size: [u32; 2]) -> Result<Truth> {
        Ok(truth::objects(&self.lit(size)?).into())
    }

    /// The room as a capture with photographs in memory, one a view, all of one size.
    pub fn capture_of(&self, photographs: Vec<Photograph>, size: [u32; 2]) -> Capture {
        let sources = photographs.into_iter().map(Arc::new);
        self.capture(sources.map(PhotographSource::Memory).collect(), size)
    }
}

impl Default for Room {
    fn default() -> Self {
        Self::new()
    }
}

/// A linear photograph without unusable pixels.
pub fn linear_photograph(size: [u32; 2], pixels: Vec<Vec3>) -> Photograph {
    Photograph::new(size, pixels, Encoding::Linear, Vec3::INFINITY)
}
