//! The photograph that objects are put into, and how light becomes its values.

use crate::capture::exposure::Exposure;
use crate::capture::photograph::Photograph;
use crate::error::{Error, Result};
use crate::export::picture::shown_at;
use crate::math::picture::Picture;
use crate::scene::camera::Camera;
use glam::Vec3;
use std::sync::Arc;

/// A photograph with its camera.
#[derive(Debug, Clone)]
pub struct Backdrop {
    /// Index of the frame; keys the random numbers.
    pub frame: u64,
    /// Where the photograph was taken from; its size is the photograph's.
    pub camera: Camera,
    /// The photograph's values, linear.
    pub photograph: Arc<Picture>,
    /// From the estimate's radiance to the photograph's values.
    pub exposure: Exposure,
    /// The value at which each channel of the photograph saturates; infinite for linear files.
    pub saturation: Vec3,
    /// The exposure at which it is shown as 8-bit sRGB: its own, or the 99th percentile of the photograph as taken at 1.
    pub shown_at: f32,
}

impl Backdrop {
    /// The backdrop of a frame; `exposure` is the estimate's for it.
    ///
    /// # Errors
    /// Camera and photograph differ in size.
    pub fn new(
        frame: usize,
        camera: &Camera,
        photograph: &Photograph,
        exposure: Exposure,
    ) -> Result<Self> {
        let picture = Picture {
            width: photograph.width,
            height: photograph.height,
            pixels: photograph.pixels.clone(),
        };
        let size = (camera.intrinsics.width, camera.intrinsics.height);
        if !picture.is_whole() || size != (picture.width, picture.height) {
            return Err(Error::new(
                format!("frame {frame}"),
                format!(
                    "the photograph is {} × {}, its camera {} × {}",
                    picture.width, picture.height, size.0, size.1
                ),
                "give both one size",
            ));
        }
        Ok(Self {
            frame: frame as u64,
            camera: camera.clone(),
            shown_at: shown_at(photograph.saturation, &picture.pixels),
            photograph: Arc::new(picture),
            exposure,
            saturation: photograph.saturation,
        })
    }

    /// The factor from radiance to the photograph's value at a pixel.
    pub fn exposure_at(&self, pixel: usize) -> Vec3 {
        let size = [self.photograph.width, self.photograph.height];
        self.exposure.at(&self.camera.intrinsics, size, pixel)
    }

    /// The pixel with a surface over `alpha` of it: α · over + (1 − α) · (photograph + over − under), where `over` and
    /// `under` are radiances with and without.
    ///
    /// A channel that is saturated in the photograph was at least as bright as the estimate says, and a saturating
    /// photograph's composite saturates with it.
    pub fn blend(&self, pixel: usize, alpha: f32, over: Vec3, under: Vec3) -> Vec3 {
        let photograph = self.photograph.pixels[pixel];
        let exposure = self.exposure_at(pixel);
        let (over, under) = (over * exposure, under * exposure);
        if !self.saturation.is_finite() {
            return over * alpha + (photograph + over - under) * (1.0 - alpha);
        }
        let saturated = photograph.cmpge(self.saturation);
        let behind = Vec3::select(saturated, photograph.max(under), photograph);
        (over * alpha + (behind + over - under) * (1.0 - alpha)).clamp(Vec3::ZERO, self.saturation)
    }
}
