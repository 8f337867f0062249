//! Photographs in linear light.

use crate::capture::camera::Intrinsics;
use crate::capture::orientation::Orientation;
use crate::capture::read;
use crate::error::Result;
use crate::math::picture::Picture;
use glam::{BVec3, Vec3};
use std::path::PathBuf;
use std::sync::Arc;

/// How a file stores light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// Linear radiance (EXR, HDR).
    Linear,
    /// sRGB curve, 8 bits a channel (PNG, JPEG): saturates at 1.
    Srgb8,
    /// sRGB curve, 16 bits a channel (PNG): saturates at 1.
    Srgb16,
}

/// Linear values of an image, row by row from the top left.
#[derive(Debug, Clone)]
pub struct Photograph {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Linear radiance (file value / exposure) of each pixel: its mean over the pixel's area.
    pub pixels: Vec<Vec3>,
    /// Whether each pixel may be used (alpha mask, finite values); empty means all.
    pub usable: Vec<bool>,
    /// How the file stored the values.
    pub encoding: Encoding,
    /// The value at which each channel saturates, in the units of `pixels`; infinite for linear files.
    pub saturation: Vec3,
    /// The same for each pixel, where it is not one value for all of them; else empty. The mean of pixels of which some are
    /// saturated is at its own limit.
    pub limits: Vec<Vec3>,
}

/// Pixels above this fraction of saturation may have been brighter than they show.
pub const BELOW_SATURATION: f32 = 0.97;

impl Photograph {
    /// The photograph turned or mirrored.
    pub fn oriented(&self, orientation: Orientation) -> Self {
        let size = [self.width, self.height];
        let [width, height] = orientation.size(size);
        let usable = match self.usable.len() {
            0 => Vec::new(),
            _ => orientation.apply(&self.usable, size),
        };
        let limits = match self.limits.len() {
            0 => Vec::new(),
            _ => orientation.apply(&self.limits, size),
        };
        Self {
            width,
            height,
            pixels: orientation.apply(&self.pixels, size),
            usable,
            limits,
            ..*self
        }
    }

    /// Its values as a picture.
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

    /// The channels in which a pixel may have been brighter than it shows: its value there is a lower bound.
    pub fn saturated(&self, pixel: usize) -> BVec3 {
        self.pixels[pixel].cmpge(self.limit(pixel) * BELOW_SATURATION)
    }

    /// The value at which each channel of a pixel saturates.
    pub fn limit(&self, pixel: usize) -> Vec3 {
        *self.limits.get(pixel).unwrap_or(&self.saturation)
    }

    /// Whether a pixel may have been brighter than it shows, in any channel.
    pub fn is_saturated(&self, pixel: usize) -> bool {
        self.saturated(pixel).any()
    }
}

/// Where a photograph's pixels come from.
#[derive(Debug, Clone)]
pub enum PhotographSource {
    /// A file, read when needed, and how it lies in it.
    File(PathBuf, Orientation),
    /// Already in memory.
    Memory(Arc<Photograph>),
}

impl PhotographSource {
    /// Reads the photograph and divides by the exposure.
    ///
    /// # Errors
    /// The file cannot be read, is no image, or has another size than the camera.
    pub fn load(&self, intrinsics: &Intrinsics, exposure: Option<f64>) -> Result<Arc<Photograph>> {
        Ok(self.load_counted(intrinsics, exposure)?.0)
    }

    /// [`PhotographSource::load`], and the number of pixels whose values are impossible: not finite or negative.
    ///
    /// # Errors
    /// As [`PhotographSource::load`].
    pub fn load_counted(
        &self,
        intrinsics: &Intrinsics,
        exposure: Option<f64>,
    ) -> Result<(Arc<Photograph>, usize)> {
        match self {
            Self::Memory(photograph) => Ok((photograph.clone(), 0)),
            Self::File(path, orientation) => {
                let (photograph, invalid) =
                    read::image::read(path, *orientation, intrinsics, exposure)?;
                Ok((Arc::new(photograph), invalid))
            }
        }
    }

    /// The photograph turned or mirrored, after what is done to it already.
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
