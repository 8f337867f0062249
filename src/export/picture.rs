//! Linear pictures as PNG: exposure, then the sRGB curve, without tone mapping.

use crate::error::{Error, Result};
use crate::export::atomic::write_atomically;
use crate::math::color::to_srgb8;
use crate::math::picture::Picture;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, RgbImage};
use std::path::Path;

/// The exposure that maps the 99th percentile of the finite channel values to 1.
///
/// If that percentile is not positive (a black picture with few lights), it maps the largest value to 1. It is 1 for a picture
/// without positive values.
pub fn percentile_exposure(pixels: &[glam::Vec3]) -> f32 {
    let channels = pixels.iter().flat_map(|c| c.to_array());
    let mut values: Vec<f32> = channels.filter(|v| v.is_finite()).collect();
    if values.is_empty() {
        return 1.0;
    }
    let brightest = values.iter().copied().fold(0.0, f32::max);
    let rank = (values.len() - 1) * 99 / 100;
    let (_, percentile, _) = values.select_nth_unstable_by(rank, f32::total_cmp);
    let is_black = *percentile <= 0.0;
    let white = if is_black { brightest } else { *percentile };
    if white > 0.0 { white.recip() } else { 1.0 }
}

/// The exposure for display: that of a saturating photograph, else the [`percentile_exposure`] of `pixels`.
pub fn shown_at(saturation: glam::Vec3, pixels: &[glam::Vec3]) -> f32 {
    if saturation.is_finite() {
        saturation.max_element().recip()
    } else {
        percentile_exposure(pixels)
    }
}

/// 8-bit sRGB bytes of a linear picture times an exposure.
pub fn to_srgb_bytes(picture: &Picture, exposure: f32) -> Vec<u8> {
    let pixels = picture.pixels.iter();
    pixels.flat_map(|&c| to_srgb8(c, exposure)).collect()
}

/// Writes a linear picture times an exposure as an 8-bit sRGB PNG. NaN shows as magenta.
///
/// # Errors
/// The file cannot be written, or the picture has no pixels.
pub fn write_png(path: &Path, picture: &Picture, exposure: f32) -> Result<()> {
    let bytes = to_srgb_bytes(picture, exposure);
    write_png_bytes(path, picture.width, picture.height, &bytes)
}

/// A linear picture times an exposure as the bytes of an 8-bit sRGB PNG.
///
/// # Errors
/// The picture has no pixels.
pub fn png_bytes(picture: &Picture, exposure: f32) -> image::ImageResult<Vec<u8>> {
    let mut encoded = Vec::new();
    let (bytes, format) = (to_srgb_bytes(picture, exposure), ExtendedColorType::Rgb8);
    let encoder = PngEncoder::new(&mut encoded);
    encoder.write_image(&bytes, picture.width, picture.height, format)?;
    Ok(encoded)
}

/// Writes an 8-bit sRGB picture as a PNG.
///
/// # Errors
/// The file cannot be written, or the picture has no pixels.
pub fn write_image(path: &Path, image: &RgbImage) -> Result<()> {
    write_png_bytes(path, image.width(), image.height(), image)
}

/// Writes 8-bit sRGB bytes (three a pixel, row by row) as a PNG, if their number matches the size.
fn write_png_bytes(path: &Path, width: u32, height: u32, bytes: &[u8]) -> Result<()> {
    let expected = u64::from(width) * u64::from(height) * 3;
    if expected == 0 || bytes.len() as u64 != expected {
        let problem = format!("{} bytes for {width} × {height} pixels", bytes.len());
        return Err(Error::file(path, problem, ""));
    }
    write_atomically(path, |writer| {
        let encoder = PngEncoder::new(writer);
        Ok(encoder.write_image(bytes, width, height, ExtendedColorType::Rgb8)?)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn exposure_puts_the_99th_percentile_at_one_at_any_scale() {
        for scale in [1e-6f32, 1.0, 1e6] {
            let pixels: Vec<Vec3> = (0..1001).map(|i| Vec3::splat(i as f32 * scale)).collect();
            let exposure = percentile_exposure(&pixels);
            assert!((exposure * 990.0 * scale - 1.0).abs() < 2e-3, "{exposure}");
        }
        let mut lamp = vec![Vec3::ZERO; 1000];
        lamp[3] = Vec3::new(4.0, 2.0, 1.0);
        assert_eq!(percentile_exposure(&lamp), 0.25);
        assert_eq!(percentile_exposure(&[Vec3::ZERO]), 1.0);
        assert_eq!(percentile_exposure(&[Vec3::NAN]), 1.0);
        assert_eq!(percentile_exposure(&[]), 1.0);
    }

    #[test]
    fn png_holds_the_srgb_curve_of_the_exposed_values() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("a.png");
        let values = [Vec3::splat(0.108), Vec3::new(9.0, 0.0, 0.5), Vec3::NAN];
        let picture = Picture {
            width: 3,
            height: 1,
            pixels: values.to_vec(),
        };
        write_png(&path, &picture, 2.0).expect("written");
        let image = image::open(&path).expect("a PNG").to_rgb8();
        // The sRGB value of 2 · 0.108 is 0.5022, which is 128.06 of 255.
        assert_eq!(image.get_pixel(0, 0).0, [128, 128, 128]);
        assert_eq!(image.get_pixel(1, 0).0, [255, 0, 255]);
        assert_eq!(image.get_pixel(2, 0).0, [255, 0, 255]);
    }
}
