//! A generated room with its photographs.

use crate::capture::Capture;
use crate::capture::truth::Truth;
use crate::math::picture::Picture;
use crate::room::generated::family::Family;
use crate::room::truth;
use crate::scene::geometry::Hit;
use crate::transport::lit::LitScene;
use glam::{Vec2, Vec3};

/// A generated room with its photographs and ground truth.
#[derive(Debug, Clone)]
pub struct Generated {
    /// Its family.
    pub family: Family,
    /// Its seed.
    pub seed: u64,
    /// Input of a solver: mesh and photographs in memory. If `capture.segmentation` is set, the mesh is to be cut into segments
    /// like that of a scan.
    pub capture: Capture,
    /// The true room, of which the photographs were rendered: geometry, materials, light and cameras, in the capture's order of
    /// frames.
    pub lit: LitScene,
}

impl Generated {
    /// The truth of each object by name; empty if the capture's mesh has no objects.
    pub fn truth(&self) -> Truth {
        match self.capture.segmentation {
            Some(_) => Truth::default(),
            None => truth::objects(&self.lit).into(),
        }
    }

    /// The true albedo of a frame, averaged over each pixel; black where no surface is visible.
    pub fn albedo(&self, frame: usize) -> Picture {
        truth::albedo_picture(&self.lit, &self.lit.scene.cameras[frame])
    }

    /// The true emission at the pixel centres of a frame; black where no surface is visible.
    pub fn emission(&self, frame: usize) -> Picture {
        let camera = &self.lit.scene.cameras[frame];
        let emitted = |hit: &Hit| {
            let object = self.lit.scene.object_of[hit.triangle as usize];
            self.lit.materials[object as usize].emission
        };
        Picture::from_fn(camera.intrinsics.width, camera.intrinsics.height, |x, y| {
            let center = Vec2::new(x as f32, y as f32) + 0.5;
            let hit = self.lit.scene.intersect(&camera.ray(center));
            hit.as_ref().map_or(Vec3::ZERO, emitted)
        })
    }
}
