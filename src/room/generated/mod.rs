//! Rooms generated at random from a seed, in families. Settings are chosen and tested on them instead of on captures.
//!
//! Each family has its own difficulty. Rooms differ in size, light, colours and views. (Family, seed, size) gives the same bits.

mod clutter;
mod family;
mod furnisher;
mod glossy;
mod patterned;
mod phone;
mod photographed;
mod plain;
mod scanned;
mod sparse;
mod unseen;
mod white;
mod window;

pub use family::Family;
pub use photographed::Generated;

use crate::error::Result;
use crate::room::Room;
use crate::room::photographs::{self, Rendering};
use furnisher::Furnisher;
use photographed::Draft;

/// Furnishes room `seed` of a family for photographs of a size in pixels.
fn draft(family: Family, seed: u64, size: [u32; 2]) -> Draft {
    let furnish = match family {
        Family::Plain => plain::furnish,
        Family::Unseen => unseen::furnish,
        Family::Window => window::furnish,
        Family::Clutter => clutter::furnish,
        Family::Patterned => patterned::furnish,
        Family::Glossy => glossy::furnish,
        Family::White => white::furnish,
        Family::Sparse => sparse::furnish,
        Family::Phone => phone::furnish,
        Family::Scanned => scanned::furnish,
    };
    let mut furnisher = Furnisher::new(seed, family as u64);
    furnish(&mut furnisher, size);
    Draft::new(family, seed, size, furnisher)
}

/// Plain room `seed` and the rendering of its photographs at a size in pixels, with 8 to 64 samples per pixel.
pub fn generate(seed: u64, size: [u32; 2]) -> (Room, Rendering) {
    let plain = draft(Family::Plain, seed, size);
    (plain.room, plain.rendering)
}

impl Family {
    /// Generates room `seed` of the family, with photographs of a size in pixels.
    ///
    /// # Errors
    /// A temporary file cannot be written (`scanned`), or photographs of this size see no surface.
    pub fn generate(self, seed: u64, size: [u32; 2]) -> Result<Generated> {
        let draft = draft(self, seed, size);
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
