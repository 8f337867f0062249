//! A furnished room that is yet to be photographed.

use crate::capture::photograph::Photograph;
use crate::error::Result;
use crate::math::rng::splitmix64;
use crate::room::generated::family::Family;
use crate::room::generated::furnisher::Furnisher;
use crate::room::generated::photographed::Generated;
use crate::room::model::Room;
use crate::room::photographs::Rendering;
use crate::transport::environment::Environment;
use crate::transport::lit::LitScene;
use std::sync::Arc;

/// Key of the photographs' random seed.
const PHOTOGRAPH_KEY: u64 = 0x6e6f_6973_6500;

/// A room, its light from outside, and the settings of its photographs.
pub struct Draft {
    /// Its family.
    pub family: Family,
    /// Its seed.
    pub seed: u64,
    /// Mesh, materials and views.
    pub room: Room,
    /// Light from outside.
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
            rendering: Rendering {
                seed: splitmix64(seed ^ PHOTOGRAPH_KEY),
                samples: furnisher.samples,
                size,
            },
        }
    }

    /// The room with its true materials and light.
    ///
    /// # Errors
    /// As [`Room::lit`].
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
