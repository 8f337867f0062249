//! Photographs in linear light.

use crate::capture::orientation::Orientation;
use crate::math::picture::Picture;
use glam::{BVec3, Vec3};
use std::path::PathBuf;
use std::sync::Arc;

/// How a file stores light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// Linear radiance (EXR, HDR).
    Linear,
    /// sRGB curve, 8 bits per channel (PNG, JPEG); saturates at 1.
    Srgb8,
    /// sRGB curve, 16 bits per channel (PNG); saturates at 1.
    Srgb16,
}

/// A photograph in linear radiance, row by row from the top left.
#[derive(Debug, Clone)]
pub struct Photograph {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Linear radiance (linearised file value / exposure), the mean over each pixel's area.
    pub pixels: Vec<Vec3>,
    /// Whether each pixel may be used (alpha mask, finite values); empty means all.
    pub usable: Vec<bool>,
    /// How the file stored the values.
    pub encoding: Encoding,
    /// The value at which each channel saturates, in the units of `pixels`; infinite for linear files.
    pub saturation: Vec3,
    /// The saturation value of each pixel, where pixels differ, as where one averages some saturated ones; else empty.
    pub limits: Vec<Vec3>,
}

/// Fraction of the saturation value from which a pixel counts as saturated (its value is a lower bound).
pub const BELOW_SATURATION: f32 = 0.97;

impl Photograph {
    /// A photograph whose pixels may all be used and saturate alike.
    pub fn new(
        [width, height]: [u32; 2],
        pixels: Vec<Vec3>,
        encoding: Encoding,
        saturation: Vec3,
    ) -> Self {
        Self {
            width,
            height,
            pixels,
            usable: Vec::new(),
            encoding,
            saturation,
            limits: Vec::new(),
        }
    }

    /// The photograph in another orientation.
    pub fn oriented(&self, orientation: Orientation) -> Self {
        let size = [self.width, self.height];
        let [width, height] = orientation.size(size);
        Self {
            width,
            height,
            pixels: orientation.apply(&self.pixels, size),
            usable: orientation.apply(&self.usable, size),
            limits: orientation.apply(&self.limits, size),
            ..*self
        }
    }

    /// The photograph with none of its pixels usable.
    pub fn masked(&self) -> Self {
        Self {
            usable: vec![false; self.pixels.len()],
            ..self.clone()
        }
    }

    /// A copy of the pixels as a picture.
    pub fn picture(&self) -> Picture {
        Picture {
            width: self.width,
            height: self.height,
            pixels: self.pixels.clone(),
        }
    }

    /// Whether a pixel may be used.
    pub fn is_usable(&self, pixel: usize) -> bool {
        self.usable.is_empty() || self.usable[pixel]
    }

    /// The saturated channels of a pixel: their values are lower bounds.
    pub fn saturated(&self, pixel: usize) -> BVec3 {
        self.pixels[pixel].cmpge(self.limit(pixel) * BELOW_SATURATION)
    }

    /// The value at which each channel of a pixel saturates.
    pub fn limit(&self, pixel: usize) -> Vec3 {
        *self.limits.get(pixel).unwrap_or(&self.saturation)
    }

    /// Whether any channel of a pixel is saturated.
    pub fn is_saturated(&self, pixel: usize) -> bool {
        self.saturated(pixel).any()
    }
}

/// Where a photograph's pixels come from.
#[derive(Debug, Clone)]
pub enum PhotographSource {
    /// A file, read when needed, and its orientation.
    File(PathBuf, Orientation),
    /// Already in memory.
    Memory(Arc<Photograph>),
}

impl PhotographSource {
    /// The photograph with `orientation` applied after its own.
    pub fn oriented(&self, orientation: Orientation) -> Self {
        match self {
            Self::File(path, before) => Self::File(path.clone(), before.then(orientation)),
            Self::Memory(same) if orientation == Orientation::default() => {
                Self::Memory(same.clone())
            }
            Self::Memory(photograph) => Self::Memory(Arc::new(photograph.oriented(orientation))),
        }
    }
}
