//! Photographs of the room: path-traced anew, or those kept in the program.

use crate::capture::photograph::{Encoding, Photograph};
use crate::error::{Error, Result};
use crate::export::atomic::write_bytes;
use crate::export::exr::{Precision, write_rgb};
use crate::room::Room;
use crate::transport::film::Film;
use crate::transport::lit::Lit;
use crate::transport::path::PathOptions;
use glam::Vec3;
use image::ImageFormat;
use std::path::Path;
use std::sync::Arc;

/// The rendering that is kept in the program.
pub const KEPT: Rendering = Rendering {
    seed: 7,
    samples: 256,
    size: [160, 120],
};

/// The kept photographs: half-float EXR files, in the order of the cameras.
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

/// How photographs are rendered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rendering {
    /// Key of all random numbers; other seeds give independent noise.
    pub seed: u64,
    /// Paths a pixel.
    pub samples: u32,
    /// Width and height in pixels.
    pub size: [u32; 2],
}

/// Renders one photograph a camera: the mean over each pixel of the radiance of all bounces, unbiased.
///
/// # Errors
/// As [`Room::lit`].
pub fn render(room: &Room, rendering: &Rendering) -> Result<Vec<Photograph>> {
    Ok(render_lit(&room.lit(rendering.size)?, rendering))
}

/// The same of a room that is lit already, by light from outside too.
pub fn render_lit(world: &Lit, rendering: &Rendering) -> Vec<Photograph> {
    let options = PathOptions::default();
    let photograph = |(frame, camera)| {
        let mut film = Film::new(camera);
        let samples = rendering.samples;
        film.add(world, camera, &options, rendering.seed, frame, samples);
        linear(rendering.size, film.mean())
    };
    (0u64..).zip(&world.scene.cameras).map(photograph).collect()
}

/// The photographs kept in the program.
///
/// # Errors
/// The program file is damaged.
pub fn kept() -> Result<Vec<Photograph>> {
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
        Ok(linear([image.width(), image.height()], pixels))
    };
    FILES.iter().enumerate().map(decode).collect()
}

/// Writes the kept photographs as NNN.exr, byte for byte.
///
/// # Errors
/// The folder cannot be written.
pub fn write_kept(folder: &Path) -> Result<()> {
    for (index, bytes) in FILES.iter().enumerate() {
        write_bytes(&folder.join(format!("{index:03}.exr")), bytes)?;
    }
    Ok(())
}

/// Writes photographs as NNN.exr in half precision, far finer than their noise.
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

/// A photograph without light, for scenes that need cameras alone.
pub fn black([width, height]: [u32; 2]) -> Arc<Photograph> {
    let pixels = vec![Vec3::ZERO; width as usize * height as usize];
    Arc::new(linear([width, height], pixels))
}

/// A linear photograph that may be used everywhere.
pub fn linear([width, height]: [u32; 2], pixels: Vec<Vec3>) -> Photograph {
    Photograph {
        width,
        height,
        pixels,
        usable: Vec::new(),
        encoding: Encoding::Linear,
        saturation: Vec3::INFINITY,
        limits: Vec::new(),
    }
}
