//! Photographs of the room: rendered, or stored in the program.

use crate::capture::Capture;
use crate::capture::photograph::Photograph;
use crate::error::{Error, Result};
use crate::export::atomic::write_bytes;
use crate::export::exr::{Precision, write_rgb};
use crate::math::rng::Stream;
use crate::room::model::{Room, linear_photograph};
use crate::transport::film::Film;
use crate::transport::lit::LitScene;
use crate::transport::path::PathOptions;
use glam::Vec3;
use image::ImageFormat;
use std::path::Path;

/// The rendering that is stored in the program.
pub const STORED: Rendering = Rendering::new(7, 256, [640, 480]);

macro_rules! stored {
    ($($number:literal)*) => {
        [$(include_bytes!(concat!("../../assets/room/", $number, ".exr"))),*]
    };
}

/// The stored photographs: half-float EXR files, in the order of the views. Rendered by `relit demo --seed 7`, which makes the same
/// but for the rounding, and compressed anew without loss by OpenEXR, whose PIZ takes a fifth less than the crate's.
const FILES: [&[u8]; 16] = stored!(
    "000" "001" "002" "003" "004" "005" "006" "007" "008" "009" "010" "011" "012" "013" "014" "015"
);

/// Significant bits of the values in written photographs: rounding is then off by 2 % in the root of the mean square, less
/// than the noise of 256 samples (about 5 %), and makes files about half as large.
const SIGNIFICANT_BITS: u32 = 5;

/// Seed of the rounding, apart from those of paths.
const ROUNDING_SEED: u64 = 0x726f_756e_6465_6421;

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

impl Rendering {
    /// Settings of a seed, a number of samples and a size.
    pub const fn new(seed: u64, samples: u32, size: [u32; 2]) -> Self {
        Self {
            seed,
            samples,
            size,
        }
    }
}

impl Room {
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
pub fn render_lit(world: &LitScene, rendering: &Rendering) -> Vec<Photograph> {
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
                let remedy = "reinstall relit";
                Error::new(format!("built-in photograph {index}"), error, remedy)
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

/// Writes photographs as NNN.exr in half precision, rounded to [`SIGNIFICANT_BITS`].
///
/// # Errors
/// The folder cannot be written.
pub fn write(folder: &Path, photographs: &[Photograph]) -> Result<()> {
    for (index, photograph) in photographs.iter().enumerate() {
        let mut picture = photograph.picture();
        for (pixel, value) in picture.pixels.iter_mut().enumerate() {
            let mut stream = Stream::new(ROUNDING_SEED, index as u64, pixel as u64, 0);
            *value = value.map(|channel| rounded(channel, &mut stream));
        }
        let path = folder.join(format!("{index:03}.exr"));
        write_rgb(&path, &picture, Precision::Half)?;
    }
    Ok(())
}

/// Rounds to [`SIGNIFICANT_BITS`], up or down at random so that the mean stays. `value` ≥ 0.
fn rounded(value: f32, stream: &mut Stream) -> f32 {
    let dropped = (1 << (f32::MANTISSA_DIGITS - SIGNIFICANT_BITS)) - 1;
    let bits = value.to_bits() + (stream.next_u32() & dropped);
    f32::from_bits(bits & !dropped)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean of 40,000 roundings is within 4 standard errors, and none is further off than one step.
    #[test]
    fn rounding_keeps_the_mean() {
        const COUNT: u32 = 40_000;
        let step_size = 2.0f64.powi(1 - SIGNIFICANT_BITS as i32);
        let mut stream = Stream::new(1, 0, 0, 0);
        for value in [0.0, 1.0, 1.337, 0.024_71, 17.93] {
            let mut sum = 0.0;
            for _ in 0..COUNT {
                let off = f64::from(rounded(value, &mut stream)) - f64::from(value);
                assert!(off.abs() <= f64::from(value) * step_size, "{value} {off}");
                sum += off;
            }
            let error = f64::from(value) * step_size / 2.0 / f64::from(COUNT).sqrt();
            assert!((sum / f64::from(COUNT)).abs() <= 4.0 * error, "{value}");
        }
    }
}
