//! 16-bit depth images.

use crate::capture::scan::lens::Lens;
use crate::error::{Error, Result};
use glam::DVec2;
use image::{DynamicImage, ImageBuffer, ImageReader, Limits, Luma};
use std::path::{Path, PathBuf};

/// Relative difference above which neighbouring depths lie on different surfaces.
const JUMP: f32 = 0.05;

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
    /// A depth image in which only 0 marks missing depth.
    pub fn new(path: PathBuf, lens: Lens, metres_per_unit: f64) -> Self {
        Self {
            path,
            lens,
            metres_per_unit,
            invalid: None,
        }
    }

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

    /// The decoded image.
    ///
    /// # Errors
    /// As [`DepthImage::raw`].
    pub fn map(&self) -> Result<DepthMap> {
        Ok(DepthMap {
            lens: self.lens,
            metres: self.metres()?,
        })
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

/// A decoded depth image.
#[derive(Debug)]
pub struct DepthMap {
    /// The depth camera.
    pub lens: Lens,
    /// Metres along the optical axis, row by row; 0 where nothing was measured.
    pub metres: Vec<f32>,
}

impl DepthMap {
    /// The measured depth in metres at a pixel position. Inverse depth is interpolated bilinearly, which is exact for planes;
    /// at depth discontinuities and next to missing depth the nearest pixel is used.
    pub fn at(&self, pixel: DVec2) -> Option<f32> {
        let k = &self.lens.pinhole;
        let nearest = self.of_pixel(pixel.x.floor() as i64, pixel.y.floor() as i64)?;
        let corner = pixel - DVec2::splat(0.5);
        let (i, j) = (corner.x.floor(), corner.y.floor());
        let (u, v) = ((corner.x - i) as f32, (corner.y - j) as f32);
        let (i, j) = (i as i64, j as i64);
        if i < 0 || j < 0 || i + 1 >= i64::from(k.width) || j + 1 >= i64::from(k.height) {
            return Some(nearest);
        }
        let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| self.of_pixel(i + x, j + y));
        let [Some(a), Some(b), Some(c), Some(d)] = four else {
            return Some(nearest);
        };
        let low = a.min(b).min(c).min(d);
        let high = a.max(b).max(c).max(d);
        if high - low > JUMP * low {
            return Some(nearest);
        }
        let inverse = (1.0 - v) * ((1.0 - u) / a + u / b) + v * ((1.0 - u) / c + u / d);
        Some(1.0 / inverse)
    }

    fn of_pixel(&self, i: i64, j: i64) -> Option<f32> {
        let k = &self.lens.pinhole;
        let inside = i >= 0 && j >= 0 && i < i64::from(k.width) && j < i64::from(k.height);
        let depth = inside.then(|| self.metres[(j * i64::from(k.width) + i) as usize])?;
        (depth > 0.0).then_some(depth)
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
