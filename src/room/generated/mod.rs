//! Rooms generated at random from a seed, in families. Settings are chosen and tested on them instead of on captures.
//!
//! Each family has its own difficulty. Rooms differ in size, light, colours and views. (Family, seed, size) gives the same bits.

mod clutter;
mod furnisher;
mod glossy;
mod patterned;
mod phone;
mod photographed;
mod scanned;
mod sky;
mod sparse;
mod unseen;
mod white;
mod window;

pub use photographed::Generated;

use crate::error::Result;
use crate::export::capture as folder;
use crate::export::exr::{Precision, write_rgb};
use crate::export::new_folder::NewFolder;
use crate::math::picture::Picture;
use crate::room::photographs::{self, Rendering};
use crate::room::{Room, write_truth};
use crate::transport::environment::{pixel_of, row_solid_angle};
use furnisher::Furnisher;
use photographed::Draft;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A kind of generated room. Its number is a key of the random numbers of its rooms.
#[derive(
    Debug, Clone, Copy, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum Family {
    /// Lamps in view.
    #[default]
    Plain = 0,
    /// No lamp in view.
    Unseen = 1,
    /// Light from outside.
    Window = 2,
    /// Hundreds of objects.
    Clutter = 3,
    /// Textures.
    Patterned = 4,
    /// Specular lobes.
    Glossy = 5,
    /// Many bounces.
    White = 6,
    /// Few and noisy photographs.
    Sparse = 7,
    /// Photographs like a phone's.
    Phone = 8,
    /// Photographs like a phone's, and a mesh fused from depth images.
    Scanned = 9,
}

/// A plain room: shell, one to five lamps, up to fourteen pieces of furniture, four to twelve views.
fn plain(f: &mut Furnisher, _size: [u32; 2]) {
    f.shell();
    f.lamps();
    f.furniture();
    f.look_around(4, 12);
    f.expose(8.0, 64.0);
}

/// Furnishes room `seed` of a family for photographs of a size in pixels.
fn draft(family: Family, seed: u64, size: [u32; 2]) -> Draft {
    let furnish = match family {
        Family::Plain => plain,
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

/// Photographs a room as its family is photographed. Fails as [`Family::generate`] does.
fn photographed(draft: Draft) -> Result<Generated> {
    match draft.family {
        Family::Sparse => sparse::photograph(draft),
        Family::Phone => phone::photograph(draft),
        Family::Scanned => scanned::scan(draft),
        _ => {
            let lit = draft.lit()?;
            let taken = photographs::render_lit(&lit, &draft.rendering);
            Ok(draft.photographed(lit, taken))
        }
    }
}

/// Writes room `seed` of a family into a new or empty folder, atomically: transforms.json, mesh.obj, images, truth/outside.exr if it
/// has light from outside (a sun lights one pixel), and truth.json and truth/albedo_NNN.exr where the mesh is the room's own.
///
/// # Errors
/// The room cannot be generated (see [`Family::generate`]), the folder is not empty, or a file cannot be written.
pub fn write(out: &Path, family: Family, seed: u64, size: [u32; 2]) -> Result<()> {
    let new = NewFolder::new(out)?;
    let draft = draft(family, seed, size);
    let rendering = draft.rendering;
    let room = photographed(draft)?;
    folder::write(new.path(), &room.capture)?;
    if room.capture.segmentation.is_none() {
        write_truth(new.path(), &room.capture.name, &room.lit, &rendering)?;
    }
    if let Some(outside) = &room.lit.outside {
        let [width, height] = outside.size().map(|side| side as u32);
        let mut pixels = outside.pixels().to_vec();
        if let Some(sun) = outside.sun() {
            let [columns, rows] = outside.size();
            let pixel = pixel_of(columns, rows, sun.direction);
            let solid_angle = row_solid_angle(pixel / columns, columns, rows) as f32;
            pixels[pixel] += sun.irradiance / solid_angle;
        }
        let picture = Picture {
            width,
            height,
            pixels,
        };
        let path = new.path().join("truth/outside.exr");
        write_rgb(&path, &picture, Precision::Float)?;
    }
    new.commit()
}

impl Family {
    /// All families.
    pub const ALL: [Self; 10] = [
        Self::Plain,
        Self::Unseen,
        Self::Window,
        Self::Clutter,
        Self::Patterned,
        Self::Glossy,
        Self::White,
        Self::Sparse,
        Self::Phone,
        Self::Scanned,
    ];

    /// Their names on the command line and in files, in the same order.
    pub const NAMES: [&'static str; Self::ALL.len()] = [
        "plain",
        "unseen",
        "window",
        "clutter",
        "patterned",
        "glossy",
        "white",
        "sparse",
        "phone",
        "scanned",
    ];

    /// Name on the command line and in files.
    pub const fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }

    /// The family with a name.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|family| family.name() == name)
    }

    /// Generates room `seed` of the family, with photographs of a size in pixels.
    ///
    /// # Errors
    /// A temporary file cannot be written (`scanned`), or photographs of this size see no surface.
    pub fn generate(self, seed: u64, size: [u32; 2]) -> Result<Generated> {
        photographed(draft(self, seed, size))
    }
}
