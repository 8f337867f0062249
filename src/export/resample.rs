//! Resamples photographs and depth images of lenses that captures do not support to a pinhole of the same focal length.

use crate::capture::import::Lens;
use crate::capture::photograph::{Encoding, Photograph};
use crate::error::{Error, Result};
use crate::export::atomic::write_atomically;
use crate::export::exr::{Layer, Precision, write_layers};
use crate::math::color::linear_to_srgb;
use exr::prelude::FlatSamples;
use glam::{DVec2, Vec3};
use image::codecs::png::PngEncoder;
use image::{ImageBuffer, Luma, Rgba};
use rayon::prelude::*;
use std::path::Path;

/// Position in the lens's image of the pinhole's pixel centre (i, j); `None` where the lens is not defined.
fn source_of(lens: &Lens, i: u32, j: u32) -> Option<DVec2> {
    let center = DVec2::new(f64::from(i), f64::from(j)) + 0.5;
    lens.project(lens.pinhole.normalized(center).extend(1.0))
}

/// The photograph as the pinhole of [`Lens::intrinsics`] would have taken it, interpolated bilinearly in linear light. Pixels
/// outside of the lens's image, or interpolated from unusable ones, are unusable.
pub fn photograph(source: &Photograph, lens: &Lens) -> Photograph {
    let (width, height) = (source.width, source.height);
    let sampled: Vec<Option<Vec3>> = (0..width * height)
        .into_par_iter()
        .map(|index| {
            let at = source_of(lens, index % width, index / width)?;
            let inside =
                at.x >= 0.0 && at.y >= 0.0 && at.x <= f64::from(width) && at.y <= f64::from(height);
            if !inside {
                return None;
            }
            let corner = at - DVec2::splat(0.5);
            let floor = corner.floor();
            let (u, v) = ((corner.x - floor.x) as f32, (corner.y - floor.y) as f32);
            let pixel = |dx: i64, dy: i64| -> Option<Vec3> {
                let x = (floor.x as i64 + dx).clamp(0, i64::from(width) - 1);
                let y = (floor.y as i64 + dy).clamp(0, i64::from(height) - 1);
                let i = y as usize * width as usize + x as usize;
                source.is_usable(i).then(|| source.pixels[i])
            };
            let top = pixel(0, 0)?.lerp(pixel(1, 0)?, u);
            let bottom = pixel(0, 1)?.lerp(pixel(1, 1)?, u);
            Some(top.lerp(bottom, v))
        })
        .collect();
    Photograph {
        pixels: sampled.iter().map(|c| c.unwrap_or(Vec3::ZERO)).collect(),
        usable: sampled.iter().map(Option::is_some).collect(),
        limits: Vec::new(),
        ..*source
    }
}

/// Depth values as the pinhole would have seen them: the nearest pixel's, 0 outside of the lens's image.
pub fn depth(values: &[u16], lens: &Lens) -> Vec<u16> {
    let k = lens.intrinsics();
    let (width, height) = (k.width, k.height);
    (0..width * height)
        .into_par_iter()
        .map(|index| {
            let Some(at) = source_of(lens, index % width, index / width) else {
                return 0;
            };
            let inside =
                at.x >= 0.0 && at.y >= 0.0 && at.x < f64::from(width) && at.y < f64::from(height);
            match inside {
                true => values[at.y as usize * width as usize + at.x as usize],
                false => 0,
            }
        })
        .collect()
}

/// Writes a photograph, unusable pixels transparent: `NAME.exr` for linear values, else a 16-bit `NAME.png`. Returns the extension.
///
/// # Errors
/// The file cannot be written.
pub fn write_photograph(stem: &Path, photograph: &Photograph) -> Result<&'static str> {
    let (width, height) = (photograph.width, photograph.height);
    if photograph.encoding == Encoding::Linear {
        let path = stem.with_extension("exr");
        let mut layer = Layer::rgb("", &photograph.picture(), Precision::Float);
        let alpha =
            (0..photograph.pixels.len()).map(|i| f32::from(u8::from(photograph.is_usable(i))));
        (layer.channels).push(("A", FlatSamples::F32(alpha.collect())));
        write_layers(&path, width, height, vec![layer])?;
        return Ok("exr");
    }
    let path = stem.with_extension("png");
    let code = |v: f32| (linear_to_srgb(v) * 65535.0).round() as u16;
    let image: ImageBuffer<Rgba<u16>, Vec<u16>> = ImageBuffer::from_fn(width, height, |x, y| {
        let i = y as usize * width as usize + x as usize;
        let [r, g, b] = photograph.pixels[i].to_array().map(code);
        Rgba([r, g, b, u16::MAX * u16::from(photograph.is_usable(i))])
    });
    write_atomically(&path, |out| {
        Ok(image.write_with_encoder(PngEncoder::new(out))?)
    })?;
    Ok("png")
}

/// Writes 16-bit values as a greyscale PNG.
///
/// # Errors
/// The file cannot be written, or the number of values does not match the size.
pub fn write_depth(path: &Path, size: [u32; 2], values: Vec<u16>) -> Result<()> {
    let image: ImageBuffer<Luma<u16>, Vec<u16>> =
        ImageBuffer::from_raw(size[0], size[1], values)
            .ok_or_else(|| Error::file(path, "has not one depth a pixel", ""))?;
    write_atomically(path, |out| {
        Ok(image.write_with_encoder(PngEncoder::new(out))?)
    })
}
