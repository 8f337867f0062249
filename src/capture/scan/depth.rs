//! 16-bit depth images.

use crate::capture::scan::lens::Lens;
use crate::error::{Error, Result};
use image::{DynamicImage, ImageBuffer, ImageReader, Limits, Luma};
use std::path::{Path, PathBuf};

/// A depth image, its camera and its unit.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthImage {
    /// 16-bit grey PNG (or PGM).
    pub path: PathBuf,
    /// The depth camera; its pose is the photograph's.
    pub lens: Lens,
    /// Metres per unit of depth, measured along the optical axis (not along the ray).
    pub metres_per_unit: f64,
    /// A value besides 0 that marks missing depth.
    pub invalid: Option<u16>,
}

impl DepthImage {
    /// The raw values, row by row; 0 where depth is missing.
    ///
    /// # Errors
    /// The file cannot be read, is not a 16-bit grey image, or has another size than its camera.
    pub fn raw(&self) -> Result<Vec<u16>> {
        let image = decode(&self.path)?;
        let (width, height) = image.dimensions();
        let k = &self.lens.pinhole;
        if (width, height) != (k.width, k.height) {
            return Err(Error::file(
                &self.path,
                format!(
                    "is {width}×{height} pixels, but the other depth images {}×{}",
                    k.width, k.height
                ),
                "use depth images of one size",
            ));
        }
        let mut values = image.into_raw();
        if let Some(invalid) = self.invalid {
            for value in &mut values {
                if *value == invalid {
                    *value = 0;
                }
            }
        }
        Ok(values)
    }

    /// Depth in metres along the optical axis; 0 where it is missing.
    ///
    /// # Errors
    /// As [`DepthImage::raw`].
    pub fn metres(&self) -> Result<Vec<f32>> {
        let unit = self.metres_per_unit;
        let raw = self.raw()?;
        Ok(raw.iter().map(|&v| (f64::from(v) * unit) as f32).collect())
    }

    /// Whether the depth image has the photograph's field of view and distortion, at any resolution.
    pub fn is_registered_to(&self, photograph: &Lens) -> bool {
        let k = &self.lens.pinhole;
        let scaled = photograph.resized([k.width, k.height]);
        let near = |a: f64, b: f64| (a - b).abs() <= 0.005 * f64::from(k.width);
        let p = &scaled.pinhole;
        let same = near(k.fx, p.fx) && near(k.fy, p.fy) && near(k.cx, p.cx) && near(k.cy, p.cy);
        same && self.lens.model == photograph.model
    }
}

/// The raw values of a depth image.
///
/// # Errors
/// The file cannot be read, is larger than 1 GiB, or is not a 16-bit grey image.
pub fn decode(path: &Path) -> Result<ImageBuffer<Luma<u16>, Vec<u16>>> {
    let mut reader = reader(path)?;
    let mut limits = Limits::default();
    limits.max_alloc = Some(1 << 30);
    reader.limits(limits);
    let image = reader
        .decode()
        .map_err(|e| Error::file(path, format!("cannot be decoded: {e}"), "export it again"))?;
    match image {
        DynamicImage::ImageLuma16(image) => Ok(image),
        other => Err(Error::file(
            path,
            format!("is not a 16-bit grey image but {:?}", other.color()),
            "export depth as 16-bit grey PNG",
        )),
    }
}

/// Width and height of a depth image.
///
/// # Errors
/// The file cannot be read or is not an image.
pub fn size(path: &Path) -> Result<[u32; 2]> {
    let (width, height) = reader(path)?
        .into_dimensions()
        .map_err(|e| Error::file(path, format!("cannot be decoded: {e}"), "export it again"))?;
    Ok([width, height])
}

fn reader(path: &Path) -> Result<ImageReader<std::io::BufReader<std::fs::File>>> {
    let io = |e: std::io::Error| Error::io(path, &e);
    ImageReader::open(path)
        .map_err(io)?
        .with_guessed_format()
        .map_err(io)
}
