//! Frames of a scan before they become a capture's: photographs with any lens model, and 16-bit depth images.

pub mod depth;
pub mod lens;

pub use depth::DepthImage;
pub use lens::{Lens, Model};

use crate::capture::camera::Pose;
use crate::capture::orientation::Orientation;
use crate::capture::photograph::Photograph;
use crate::capture::read::image;
use crate::error::{Error, Result};
use depth::DepthMap;
use std::path::PathBuf;

/// A photograph of a scan, with its camera and its depth image.
#[derive(Debug, Clone)]
pub struct ImportedFrame {
    /// The image file.
    pub photograph: PathBuf,
    /// Lens of the photograph.
    pub lens: Lens,
    /// Camera to world, right-handed, OpenGL's camera axes.
    pub pose: Pose,
    /// Linear multiplier, radiance = value / exposure; `None` where the scan does not give one.
    pub exposure: Option<f64>,
    /// A grey image of the photograph's size; dark pixels mark pixels of the photograph that may not be used.
    pub mask: Option<PathBuf>,
    /// The depth image taken from the same position.
    pub depth: Option<DepthImage>,
}

impl ImportedFrame {
    /// A frame without exposure and mask.
    pub fn new(photograph: PathBuf, lens: Lens, pose: Pose, depth: Option<DepthImage>) -> Self {
        Self {
            photograph,
            lens,
            pose,
            exposure: None,
            mask: None,
            depth,
        }
    }

    /// Decodes the photograph and the depth image.
    ///
    /// # Errors
    /// There is no depth, or an image is broken.
    pub fn load(&self) -> Result<(Photograph, DepthMap)> {
        let Some(depth) = &self.depth else {
            return Err(Error::file(&self.photograph, "has no depth image", ""));
        };
        let (upright, lens) = (Orientation::default(), &self.lens.pinhole);
        let (photograph, _) = image::read(&self.photograph, upright, lens, self.exposure)?;
        Ok((photograph, depth.map()?))
    }
}
