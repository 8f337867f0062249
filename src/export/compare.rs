//! Pictures side by side, each with a caption.

use crate::error::{Error, Result};
use crate::export::canvas::draw_text;
use crate::export::picture::{to_srgb_bytes, write_image};
use crate::math::picture::Picture;
use image::imageops::replace;
use image::{Rgb, RgbImage};
use std::path::Path;

/// Height of the caption above each picture, in pixels.
const CAPTION: u32 = 26;
/// White space between pictures, in pixels.
const GAP: u32 = 6;

/// Writes pictures in a row, top-aligned, each below its caption, all at the same exposure.
///
/// # Errors
/// The file cannot be written, or there is no picture.
pub fn write_row(path: &Path, pictures: &[(&str, &Picture)], exposure: f32) -> Result<()> {
    write_grid(path, pictures, pictures.len().max(1), exposure)
}

/// Writes pictures in a grid of `columns` columns, each below its caption, all at the same exposure.
///
/// # Errors
/// The file cannot be written, there is no picture, or a picture's size does not match its pixels.
pub fn write_grid(
    path: &Path,
    pictures: &[(&str, &Picture)],
    columns: usize,
    exposure: f32,
) -> Result<()> {
    if let Some((caption, _)) = pictures.iter().find(|(_, picture)| !picture.is_whole()) {
        let problem = format!("\"{caption}\" has no pixels");
        return Err(Error::file(path, problem, ""));
    }
    let cell_width = pictures.iter().map(|(_, p)| p.width).max().unwrap_or(0);
    let cell_height = pictures.iter().map(|(_, p)| p.height).max().unwrap_or(0) + CAPTION;
    let columns = columns.clamp(1, pictures.len().max(1));
    let rows = pictures.len().div_ceil(columns);
    let width = (columns as u32 * (cell_width + GAP)).saturating_sub(GAP);
    let mut all = RgbImage::from_pixel(width, rows as u32 * cell_height, Rgb([255; 3]));
    for (index, (caption, picture)) in pictures.iter().enumerate() {
        let x = (index % columns) as u32 * (cell_width + GAP);
        let y = (index / columns) as u32 * cell_height;
        let middle = x + picture.width / 2;
        draw_text(&mut all, caption, middle, y + CAPTION / 2, 15, 30);
        let bytes = to_srgb_bytes(picture, exposure);
        if let Some(image) = RgbImage::from_raw(picture.width, picture.height, bytes) {
            replace(&mut all, &image, x.into(), (y + CAPTION).into());
        }
    }
    write_image(path, &all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn each_picture_lies_below_its_caption() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("compare.png");
        let red = Picture::from_fn(80, 40, |_, _| Vec3::X);
        let blue = Picture::from_fn(60, 30, |_, _| Vec3::Z);
        write_row(&path, &[("ours", &red), ("naive", &blue)], 1.0).expect("written");
        let image = image::open(&path).expect("a PNG").to_rgb8();
        assert_eq!(image.dimensions(), (2 * 80 + GAP, 40 + CAPTION));
        assert_eq!(image.get_pixel(40, CAPTION + 20).0, [255, 0, 0]);
        assert_eq!(image.get_pixel(80 + GAP + 30, CAPTION + 20).0, [0, 0, 255]);
        assert_eq!(image.get_pixel(80 + GAP + 70, CAPTION + 20).0, [255; 3]);
        let dark = (0..80).any(|x| image.get_pixel(x, CAPTION / 2).0[0] < 128);
        assert!(dark, "the caption is drawn");
        assert!(write_row(&path, &[], 1.0).is_err());
    }
}
