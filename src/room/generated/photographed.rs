//! Generated rooms before and after they are photographed.

use crate::capture::Capture;
use crate::capture::photograph::Photograph;
use crate::capture::truth::Truth;
use crate::error::Result;
use crate::math::picture::Picture;
use crate::math::rng::splitmix64;
use crate::room::generated::Family;
use crate::room::generated::furnisher::Furnisher;
use crate::room::model::Room;
use crate::room::photographs::Rendering;
use crate::room::truth;
use crate::transport::environment::Environment;
use crate::transport::lit::LitScene;
use std::sync::Arc;

/// Key of the photographs' random seed.
const PHOTOGRAPH_KEY: u64 = 0x6e6f_6973_6500;

/// A room, its light from outside, and the settings of its photographs.
pub struct Draft {
    pub family: Family,
    pub seed: u64,
    pub room: Room,
    pub outside: Option<Arc<Environment>>,
    /// Random seed, samples and size of its photographs.
    pub rendering: Rendering,
}

impl Draft {
    /// Room `seed` of a family, as furnished.
    pub fn new(family: Family, seed: u64, size: [u32; 2], furnisher: Furnisher) -> Self {
        Self {
            family,
            seed,
            room: Room {
                name: match family {
                    Family::Plain => format!("generated room {seed}"),
                    family => format!("{} room {seed}", family.name()),
                },
                mesh: furnisher.modeller.mesh,
                materials: furnisher.materials,
                views: furnisher.views,
            },
            outside: furnisher.outside,
            rendering: Rendering::new(splitmix64(seed ^ PHOTOGRAPH_KEY), furnisher.samples, size),
        }
    }

    /// The room with its true materials and light. Fails as [`Room::lit`] does.
    pub fn lit(&self) -> Result<LitScene> {
        let lit = self.room.lit(self.rendering.size)?;
        Ok(LitScene {
            outside: self.outside.clone(),
            ..lit
        })
    }

    /// The room with its photographs, one a view.
    pub fn photographed(self, lit: LitScene, photographs: Vec<Photograph>) -> Generated {
        Generated {
            family: self.family,
            seed: self.seed,
            capture: self.room.capture_of(photographs, self.rendering.size),
            lit,
        }
    }
}

/// A generated room with its photographs and ground truth.
#[derive(Debug, Clone)]
pub struct Generated {
    /// Its family.
    pub family: Family,
    /// Its seed.
    pub seed: u64,
    /// Input of a solver: mesh and photographs in memory. If `capture.segmentation` is set, the mesh is to be segmented.
    pub capture: Capture,
    /// The true room, as photographed: geometry, materials, light and cameras, in the capture's order of frames.
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
}
