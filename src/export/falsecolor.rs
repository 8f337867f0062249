//! False-colour pictures of scalar values, with a legend.

use crate::error::Result;
use crate::export::canvas::draw_text;
use crate::export::picture::{percentile_exposure, write_image};
use crate::export::scale::Scale;
use crate::math::color::luminance;
use crate::math::picture::Picture;
use glam::Vec3;
use image::imageops::replace;
use image::{Rgb, RgbImage};
use plotters::coord::ranged1d::ValueFormatter;
use std::path::Path;

/// Height of the legend below the picture, in pixels.
const LEGEND: u32 = 34;

/// Diverging colour map: blue for negative, white for zero, red for positive values in [−1, 1]; magenta for NaN.
pub fn diverging(value: f32) -> [u8; 3] {
    const STOPS: [[f32; 3]; 5] = [
        [5.0, 48.0, 97.0],
        [103.0, 169.0, 207.0],
        [247.0, 247.0, 247.0],
        [239.0, 138.0, 98.0],
        [103.0, 0.0, 31.0],
    ];
    ramp(&STOPS, (value + 1.0) * 0.5)
}

/// Sequential colour map: dark violet through green to yellow for values in [0, 1], with lightness rising evenly.
pub fn sequential(value: f32) -> [u8; 3] {
    const STOPS: [[f32; 3]; 5] = [
        [68.0, 1.0, 84.0],
        [59.0, 82.0, 139.0],
        [33.0, 145.0, 140.0],
        [94.0, 201.0, 98.0],
        [253.0, 231.0, 37.0],
    ];
    ramp(&STOPS, value)
}

/// Linear interpolation between evenly spaced stops.
fn ramp(stops: &[[f32; 3]; 5], position: f32) -> [u8; 3] {
    if position.is_nan() {
        return [255, 0, 255];
    }
    let scaled = position.clamp(0.0, 1.0) * 4.0;
    let low = (scaled as usize).min(3);
    let fraction = scaled - low as f32;
    std::array::from_fn(|i| {
        (stops[low][i] + (stops[low + 1][i] - stops[low][i]) * fraction + 0.5) as u8
    })
}

/// Writes the signed luminance of a picture (render − photograph) in diverging colours with a legend.
///
/// The scale is ± the 99th percentile of the magnitudes.
///
/// # Errors
/// The file cannot be written, or the picture has no pixels.
pub fn write_signed(path: &Path, picture: &Picture, unit: &str) -> Result<()> {
    write(path, picture, diverging, -1.0, unit)
}

/// Writes the luminance of a picture of magnitudes (a standard error) in sequential colours with a legend.
///
/// The scale runs from 0 to the 99th percentile.
///
/// # Errors
/// The file cannot be written, or the picture has no pixels.
pub fn write_magnitude(path: &Path, picture: &Picture, unit: &str) -> Result<()> {
    write(path, picture, sequential, 0.0, unit)
}

/// Formats a value with three significant digits.
fn three_digits(value: f32) -> String {
    format!("{value:.2e}")
        .parse()
        .map_or_else(|_| value.to_string(), |v: f64| Scale::format(&v))
}

/// Writes the luminance of a picture and a legend. The legend's right end is the 99th percentile of the finite magnitudes, their
/// maximum if it is zero, and 1 if all are zero; `low` is its left end as a fraction of it, `color_of` the colour of such
/// fractions.
fn write(
    path: &Path,
    picture: &Picture,
    color_of: fn(f32) -> [u8; 3],
    low: f32,
    unit: &str,
) -> Result<()> {
    let values: Vec<f32> = picture.pixels.iter().map(|&c| luminance(c)).collect();
    let magnitudes: Vec<Vec3> = values.iter().map(|v| Vec3::splat(v.abs())).collect();
    let high = percentile_exposure(&magnitudes).recip();
    let low = low * high;
    let (width, height) = (picture.width, picture.height);
    let mut image = RgbImage::from_pixel(width, height + LEGEND, Rgb([255; 3]));
    for (pixel, value) in image.pixels_mut().zip(&values) {
        pixel.0 = color_of(value / high);
    }

    // A colour bar, with the values of its ends and middle below.
    let margin = width / 8;
    let bar = (width - 2 * margin).max(1);
    for x in 0..bar {
        let fraction = x as f32 / bar as f32;
        let color = color_of((low + (high - low) * fraction) / high);
        let column = RgbImage::from_pixel(1, 10, Rgb(color));
        let (x, y) = (margin + x, height + 5);
        replace(&mut image, &column, x.into(), y.into());
    }
    let middle = (low + high) * 0.5;
    let labels = [
        (margin, three_digits(low)),
        (width / 2, format!("{} {unit}", three_digits(middle))),
        (width - margin, three_digits(high)),
    ];
    for (x, label) in labels {
        draw_text(&mut image, &label, x, height + 24, 12, 40);
    }
    write_image(path, &image)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_tell_signs_apart_and_saturate() {
        let [r, _, b] = diverging(0.7);
        assert!(r > b);
        let [r, _, b] = diverging(-0.7);
        assert!(b > r);
        assert_eq!(diverging(9.0), diverging(1.0));
        assert_eq!(diverging(f32::NAN), [255, 0, 255]);
        let lightness = |v: f32| sequential(v).map(u32::from).iter().sum::<u32>();
        assert!((0..10).all(|i| lightness(i as f32 / 10.0) < lightness((i + 1) as f32 / 10.0)));
    }

    #[test]
    fn a_signed_picture_is_written_with_its_legend_below() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("error.png");
        let picture = Picture::from_fn(160, 100, |x, _| Vec3::splat((x as f32 - 80.0) * 1e-5));
        write_signed(&path, &picture, "radiance").expect("written");
        let image = image::open(&path).expect("a PNG").to_rgb8();
        assert_eq!(image.dimensions(), (160, 100 + LEGEND));
        assert_eq!(image.get_pixel(80, 50).0, diverging(0.0));
        assert_eq!(image.get_pixel(0, 50).0, diverging(-1.0));
    }
}
