//! Cameras as capture tools write them.

use glam::{DMat3, DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// Pinhole camera with radial and tangential distortion (the OPENCV model).
///
/// Pixel (i, j) covers [i, i+1] × [j, j+1], y down; `cx`, `cy` are measured from the top-left corner.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Focal length in pixels, horizontally.
    pub fx: f64,
    /// Focal length in pixels, vertically.
    pub fy: f64,
    /// Principal point in pixels from the left edge.
    pub cx: f64,
    /// Principal point in pixels from the top edge.
    pub cy: f64,
    /// Radial k1, k2, tangential p1, p2, as in OpenCV.
    pub distortion: [f64; 4],
}

/// Rigid camera-to-world transform with OpenGL axes: x right, y up, looking down −z.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Pose {
    /// Columns are the camera's x, y and z axes in world coordinates (orthonormal).
    pub rotation: DMat3,
    /// The camera's centre in world coordinates.
    pub center: DVec3,
}

impl Pose {
    /// A world point in OpenCV's camera coordinates: x right, y down, z forwards.
    pub fn to_camera(&self, point: DVec3) -> DVec3 {
        let p = self.rotation.transpose() * (point - self.center);
        DVec3::new(p.x, -p.y, -p.z)
    }

    /// A point in OpenCV's camera coordinates in the world.
    pub fn to_world(&self, p: DVec3) -> DVec3 {
        self.rotation * DVec3::new(p.x, -p.y, -p.z) + self.center
    }
}

impl Intrinsics {
    /// A pinhole without distortion.
    pub const fn plain(size: [u32; 2], focal: [f64; 2], center: [f64; 2]) -> Self {
        Self {
            width: size[0],
            height: size[1],
            fx: focal[0],
            fy: focal[1],
            cx: center[0],
            cy: center[1],
            distortion: [0.0; 4],
        }
    }

    /// The same lens on an image scaled to another size.
    pub fn resized(&self, [width, height]: [u32; 2]) -> Self {
        let x = f64::from(width) / f64::from(self.width);
        let y = f64::from(height) / f64::from(self.height);
        Self {
            width,
            height,
            fx: self.fx * x,
            fy: self.fy * y,
            cx: self.cx * x,
            cy: self.cy * y,
            ..*self
        }
    }

    /// Normalised image coordinates (x right, y down, at unit depth) of a pixel position; distorted ones, as the lens is.
    pub fn normalized(&self, pixel: DVec2) -> DVec2 {
        (pixel - DVec2::new(self.cx, self.cy)) / DVec2::new(self.fx, self.fy)
    }

    /// The inverse of [`Intrinsics::normalized`].
    pub fn pixel(&self, p: DVec2) -> DVec2 {
        p * DVec2::new(self.fx, self.fy) + DVec2::new(self.cx, self.cy)
    }

    /// Distorted normalised image coordinates of undistorted ones (x right, y down, at unit depth).
    ///
    /// `None` beyond the radius at which the radial polynomial stops increasing: the model does not hold there.
    pub fn distort(&self, p: DVec2) -> Option<DVec2> {
        let [k1, k2, p1, p2] = self.distortion;
        if self.distortion == [0.0; 4] {
            return Some(p);
        }
        let r2 = p.length_squared();
        let slope = 1.0 + 3.0 * k1 * r2 + 5.0 * k2 * r2 * r2;
        if slope <= 0.0 {
            return None;
        }
        let radial = 1.0 + k1 * r2 + k2 * r2 * r2;
        Some(DVec2::new(
            p.x * radial + 2.0 * p1 * p.x * p.y + p2 * (r2 + 2.0 * p.x * p.x),
            p.y * radial + p1 * (r2 + 2.0 * p.y * p.y) + 2.0 * p2 * p.x * p.y,
        ))
    }

    /// Undistorted normalised image coordinates of distorted ones, by fixed-point iteration.
    pub fn undistort(&self, distorted: DVec2) -> DVec2 {
        if self.distortion == [0.0; 4] {
            return distorted;
        }
        let mut p = distorted;
        for _ in 0..20 {
            let Some(image) = self.distort(p) else { break };
            let error = distorted - image;
            p += error;
            if error.length_squared() < 1e-24 {
                break;
            }
        }
        p
    }
}
