//! A furnished room before it is photographed.

use crate::capture::photograph::Photograph;
use crate::error::Result;
use crate::math::rng::splitmix64;
use crate::room::Room;
use crate::room::generated::furnisher::Furnisher;
use crate::room::generated::{Family, Generated};
use crate::room::photographs::Rendering;
use crate::transport::environment::Environment;
use crate::transport::lit::Lit;
use std::sync::Arc;

/// Key of the noise of a room's photographs.
const NOISE: u64 = 0x6e6f_6973_6500;

/// A room, its light from outside, and how it is to be photographed.
pub struct Draft {
    /// Its family.
    pub family: Family,
    /// Its seed.
    pub seed: u64,
    /// Mesh, materials and views.
    pub room: Room,
    /// Light from outside.
    pub outside: Option<Arc<Environment>>,
    /// Noise and size of its photographs.
    pub rendering: Rendering,
}

impl Draft {
    /// Furnishes room `seed` of a family.
    pub fn new(family: Family, seed: u64, size: [u32; 2]) -> Self {
        let mut furnisher = Furnisher::new(seed, family as u64);
        family.furnish(&mut furnisher, size);
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
                seed: splitmix64(seed ^ NOISE),
                samples: furnisher.samples,
                size,
            },
        }
    }

    /// The room with its true materials and light.
    ///
    /// # Errors
    /// As [`Room::lit`].
    pub fn lit(&self) -> Result<Lit> {
        let lit = self.room.lit(self.rendering.size)?;
        Ok(Lit {
            outside: self.outside.clone(),
            ..lit
        })
    }

    /// The room with photographs, one a view.
    pub fn photographed(self, lit: Lit, photographs: Vec<Photograph>) -> Generated {
        Generated {
            family: self.family,
            seed: self.seed,
            capture: self.room.capture_of(photographs, self.rendering.size),
            lit,
        }
    }
}
