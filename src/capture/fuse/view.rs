//! A depth image and its photograph, looked up by points in space.

use crate::capture::camera::Pose;
use crate::capture::photograph::Photograph;
use crate::capture::scan::depth::DepthMap;
use crate::capture::scan::{ImportedFrame, Lens};
use crate::error::Result;
use glam::{DVec2, DVec3, Vec3};

/// A decoded frame.
pub struct View {
    /// Camera to world.
    pub pose: Pose,
    pub depth: DepthMap,
    lens: Lens,
    photograph: Photograph,
}

impl View {
    /// Decodes a frame that has depth.
    pub fn load(frame: &ImportedFrame) -> Result<Self> {
        let (photograph, depth) = frame.load()?;
        let (pose, lens) = (frame.pose, frame.lens);
        Ok(Self {
            pose,
            depth,
            lens,
            photograph,
        })
    }

    /// The photograph's linear colour at a point in camera coordinates; `None` outside it and at unusable pixels.
    pub fn color_at(&self, point: DVec3) -> Option<Vec3> {
        let pixel = self.lens.project(point)?.floor();
        let (width, height) = (self.photograph.width, self.photograph.height);
        let far = DVec2::new(f64::from(width), f64::from(height));
        if !(pixel.cmpge(DVec2::ZERO) & pixel.cmplt(far)).all() {
            return None;
        }
        let index = pixel.y as usize * width as usize + pixel.x as usize;
        let usable = self.photograph.is_usable(index);
        usable.then(|| self.photograph.pixels[index])
    }
}
