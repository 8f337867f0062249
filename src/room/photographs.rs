//! Photographs of the room: rendered, or stored in the program.

use crate::capture::Capture;
use crate::capture::photograph::Photograph;
use crate::error::{Error, Result};
use crate::export::atomic::write_bytes;
use crate::export::exr::{Precision, write_rgb};
use crate::room::model::{Room, linear_photograph};
use crate::transport::film::Film;
use crate::transport::lit::Lit;
use crate::transport::path::PathOptions;
use glam::Vec3;
use image::ImageFormat;
use std::path::Path;

/// The rendering that is stored in the program.
pub const STORED: Rendering = Rendering {
    seed: 7,
    samples: 256,
    size: [160, 120],
};

/// The stored photographs: half-float EXR files, in the order of the views.
const FILES: [&[u8]; 16] = [
    include_bytes!("../../assets/room/000.exr"),
    include_bytes!("../../assets/room/001.exr"),
    include_bytes!("../../assets/room/002.exr"),
    include_bytes!("../../assets/room/003.exr"),
    include_bytes!("../../assets/room/004.exr"),
    include_bytes!("../../assets/room/005.exr"),
    include_bytes!("../../assets/room/006.exr"),
    include_bytes!("../../assets/room/007.exr"),
    include_bytes!("../../assets/room/008.exr"),
    include_bytes!("../../assets/room/009.exr"),
    include_bytes!("../../assets/room/010.exr"),
    include_bytes!("../../assets/room/011.exr"),
    include_bytes!("../../assets/room/012.exr"),
    include_bytes!("../../assets/room/013.exr"),
    include_bytes!("../../assets/room/014.exr"),
    include_bytes!("../../assets/room/015.exr"),
];

/// Settings of rendered photographs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rendering {
    /// Random seed; different seeds give independent noise.
    pub seed: u64,
    /// Samples per pixel.
    pub samples: u32,
    /// Width and height in pixels.
    pub size: [u32; 2],
}

impl Room {
    /// The room with the photographs stored in the program.
    ///
    /// # Errors
    /// The program file is damaged.
    pub fn with_stored_photographs(&self) -> Result<Capture> {
        Ok(self.capture_of(stored()?, STORED.size))
    }

    /// The room with newly rendered photographs.
    ///
    /// # Errors
    /// As [`Room::lit`].
    pub fn photographed(&self, rendering: &Rendering) -> Result<Capture> {
        Ok(self.capture_of(render(self, rendering)?, rendering.size))
    }
}

/// Renders one photograph a camera: unbiased radiance with all bounces, averaged over each pixel.
///
/// # Errors
/// As [`Room::lit`].
pub fn render(room: &Room, rendering: &Rendering) -> Result<Vec<Photograph>> {
    Ok(render_lit(&room.lit(rendering.size)?, rendering))
}

/// The same for a lit scene, which may have light from outside.
pub fn render_lit(world: &Lit, rendering: &Rendering) -> Vec<Photograph> {
    let options = PathOptions::default();
    let photograph = |(frame, camera)| {
        let mut film = Film::new(camera);
        let samples = rendering.samples;
        film.add(world, camera, &options, rendering.seed, frame, samples);
        linear_photograph(rendering.size, film.mean())
    };
    (0u64..).zip(&world.scene.cameras).map(photograph).collect()
}

/// The photographs stored in the program.
///
/// # Errors
/// The program file is damaged.
pub fn stored() -> Result<Vec<Photograph>> {
    let decode = |(index, bytes): (usize, &&[u8])| {
        let image = image::load_from_memory_with_format(bytes, ImageFormat::OpenExr)
            .map_err(|error| {
                Error::new(
                    format!("built-in photograph {index}"),
                    error,
                    "reinstall relit",
                )
            })?
            .into_rgb32f();
        let pixels = image.pixels().map(|p| Vec3::from(p.0)).collect();
        Ok(linear_photograph([image.width(), image.height()], pixels))
    };
    FILES.iter().enumerate().map(decode).collect()
}

/// Writes the stored photographs as NNN.exr, byte for byte.
///
/// # Errors
/// The folder cannot be written.
pub fn write_stored(folder: &Path) -> Result<()> {
    for (index, bytes) in FILES.iter().enumerate() {
        write_bytes(&folder.join(format!("{index:03}.exr")), bytes)?;
    }
    Ok(())
}

/// Writes photographs as NNN.exr in half precision, whose rounding is far smaller than their noise.
///
/// # Errors
/// The folder cannot be written.
pub fn write(folder: &Path, photographs: &[Photograph]) -> Result<()> {
    for (index, photograph) in photographs.iter().enumerate() {
        let picture = photograph.picture();
        write_rgb(
            &folder.join(format!("{index:03}.exr")),
            &picture,
            Precision::Half,
        )?;
    }
    Ok(())
}
