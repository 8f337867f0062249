//! Rooms furnished at random, each from a seed, in families: to choose settings on, and to test with, without a capture's help.
//!
//! A family is a kind of room that is hard in its own way. Rooms of one family differ in size, light, colours and number of
//! photographs; the same (family, seed, size) gives the same bits.

mod clutter;
mod draft;
mod family;
mod furnisher;
mod glossy;
mod patterned;
mod phone;
mod plain;
mod scanned;
mod sparse;
mod unseen;
mod white;
mod window;

pub use family::Family;

use crate::capture::Capture;
use crate::capture::truth::Truth;
use crate::error::Result;
use crate::math::picture::Picture;
use crate::room::photographs::{self, Rendering};
use crate::room::{Room, truth};
use crate::scene::geometry::Hit;
use crate::transport::lit::Lit;
use draft::Draft;
use glam::{Vec2, Vec3};
use std::collections::BTreeMap;

/// A generated room, photographed, with all that is true of it.
#[derive(Debug, Clone)]
pub struct Generated {
    /// Its family.
    pub family: Family,
    /// Its seed.
    pub seed: u64,
    /// What a solver is given: mesh and photographs in memory. Where `capture.segmentation` is set, the mesh is to be cut into segments as
    /// for any scan.
    pub capture: Capture,
    /// The true room, in which the photographs were rendered: its geometry, materials, light and cameras. Frames are in the
    /// capture's order.
    pub lit: Lit,
}

impl Generated {
    /// What is true of each object by name; empty where the capture's mesh has no objects.
    pub fn truth(&self) -> Truth {
        let objects = match self.capture.segmentation {
            Some(_) => BTreeMap::new(),
            None => truth::objects(&self.lit),
        };
        Truth {
            objects: objects.into_iter().map(|(n, o)| (n, o.into())).collect(),
        }
    }

    /// The true albedo that a frame's pixels see, the mean over each; black where they see nothing.
    pub fn albedo(&self, frame: usize) -> Picture {
        truth::albedo_picture(&self.lit, &self.lit.scene.cameras[frame])
    }

    /// The true emission that the centres of a frame's pixels see; black where they see nothing, or light from outside.
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

/// Plain room `seed`, and how it is photographed at a size in pixels: 8 to 64 paths a pixel, so that the photographs carry
/// from much to little noise.
pub fn generate(seed: u64, size: [u32; 2]) -> (Room, Rendering) {
    let draft = Draft::new(Family::Plain, seed, size);
    (draft.room, draft.rendering)
}

impl Family {
    /// Room `seed` of the family with photographs of a size in pixels.
    ///
    /// # Errors
    /// A temporary file cannot be written (`scanned`), or photographs of this size see nothing of the room.
    pub fn generate(self, seed: u64, size: [u32; 2]) -> Result<Generated> {
        let draft = Draft::new(self, seed, size);
        match self {
            Self::Sparse => sparse::photograph(draft),
            Self::Phone => phone::photograph(draft),
            Self::Scanned => scanned::scan(draft),
            _ => {
                let lit = draft.lit()?;
                let taken = photographs::render_lit(&lit, &draft.rendering);
                Ok(draft.photographed(lit, taken))
            }
        }
    }
}
