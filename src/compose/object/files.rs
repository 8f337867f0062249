//! Files that an object file refers to. They must lie in its own folder and be of bounded size.

use crate::capture::inputs;
use crate::capture::read::confine::folder_of;
use crate::error::{Error, Result};
use crate::math::color::srgb_to_linear;
use crate::math::picture::Picture;
use glam::Vec3;
use image::{DynamicImage, ImageReader, Limits, Rgb};
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// Largest file that is read, in bytes.
const MAX_BYTES: u64 = 1 << 30;
/// Longest side of a texture file, in pixels.
const MAX_SIDE: u32 = 16_384;
/// Longest side of a texture in memory; larger ones are halved until they fit.
const KEPT_SIDE: u32 = 4096;

/// Reads a file of bounded size and records it as an input.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    let metadata = std::fs::metadata(path).map_err(|e| Error::io(path, &e))?;
    if !metadata.is_file() {
        return Err(Error::file(path, "is no regular file", "name a file"));
    }
    if metadata.len() > MAX_BYTES {
        let problem = "is larger than 1 GiB";
        return Err(Error::file(path, problem, "reduce the object"));
    }
    inputs::note(path);
    std::fs::read(path).map_err(|e| Error::io(path, &e))
}

/// Resolves a file name in `referrer`. Refuses a file outside the referrer's folder.
pub fn resolve(referrer: &Path, name: &str) -> Result<PathBuf> {
    let folder = folder_of(referrer);
    let folder = folder.canonicalize().map_err(|e| Error::io(folder, &e))?;
    let missing = |_| {
        let problem = format!("refers to `{name}`, which cannot be opened");
        Error::file(referrer, problem, "put that file beside it")
    };
    // Some exporters on Windows write backslashes.
    let wanted = folder.join(name.replace('\\', "/"));
    let found = wanted.canonicalize().map_err(missing)?;
    if !found.starts_with(&folder) {
        let problem = format!("refers to `{name}`, outside its own folder");
        let remedy = "put that file beside it and name it without a folder";
        return Err(Error::file(referrer, problem, remedy));
    }
    Ok(found)
}

/// Encoding of a texture's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum TextureKind {
    /// Colours: 8- and 16-bit files hold the sRGB curve, floating-point ones linear values.
    Color,
    /// Parameters, linear in every file.
    Data,
}

/// Decodes an image to linear values. `place` names it in errors.
pub fn decode(bytes: &[u8], meaning: TextureKind, place: &str) -> Result<Picture> {
    let broken = |e: &dyn std::fmt::Display| {
        let problem = format!("the texture cannot be read: {e}");
        let remedy = "save it as PNG or JPEG of at most 16384 pixels a side";
        Error::new(place, problem, remedy)
    };
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| broken(&e))?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    reader.limits(limits);
    let image = reader.decode().map_err(|e| broken(&e))?;
    use DynamicImage::{ImageRgb32F, ImageRgba32F};
    let is_float = matches!(image, ImageRgb32F(_) | ImageRgba32F(_));
    let linear = is_float || meaning == TextureKind::Data;
    let colors = image.to_rgb32f();
    let color = |p: &Rgb<f32>| match linear {
        true => Vec3::from(p.0),
        false => Vec3::from(p.0.map(srgb_to_linear)),
    };
    let mut picture = Picture {
        width: colors.width(),
        height: colors.height(),
        pixels: colors.pixels().map(color).collect(),
    };
    if !picture.pixels.iter().all(|c| c.is_finite()) {
        return Err(broken(&"it holds values that are not finite"));
    }
    while picture.width.max(picture.height) > KEPT_SIDE {
        picture = halved(&picture);
    }
    Ok(picture)
}

/// The picture at half size, rounded up; each pixel is the mean of 2 × 2.
fn halved(picture: &Picture) -> Picture {
    let (width, height) = (picture.width.div_ceil(2), picture.height.div_ceil(2));
    Picture::from_fn(width, height, |x, y| {
        let mut sum = Vec3::ZERO;
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let i = (2 * x + dx).min(picture.width - 1);
            let j = (2 * y + dy).min(picture.height - 1);
            sum += picture.pixels[j as usize * picture.width as usize + i as usize];
        }
        sum * 0.25
    })
}
