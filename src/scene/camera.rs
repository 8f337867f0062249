//! Cameras in scene coordinates: pixel to ray, point to pixel.

use crate::capture::camera::{Intrinsics, Pose};
use crate::scene::geometry::Ray;
use glam::{DVec2, DVec3, Mat3, Vec2, Vec3};

/// A posed camera relative to the scene's origin.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Lens and sensor.
    pub intrinsics: Intrinsics,
    /// Columns are the camera's x (right), y (up) and z (backwards) axes.
    pub rotation: Mat3,
    /// Centre of projection.
    pub center: Vec3,
}

impl Camera {
    /// A capture's camera relative to the scene's `origin`.
    pub fn new(intrinsics: &Intrinsics, pose: &Pose, origin: DVec3) -> Self {
        Self {
            intrinsics: *intrinsics,
            rotation: pose.rotation.as_mat3(),
            center: (pose.center - origin).as_vec3(),
        }
    }

    /// The ray through a point of the image plane in pixels from the top-left corner; its direction has unit length.
    #[inline]
    pub fn ray(&self, pixel: Vec2) -> Ray {
        let k = &self.intrinsics;
        let distorted = DVec2::new(
            (f64::from(pixel.x) - k.cx) / k.fx,
            (f64::from(pixel.y) - k.cy) / k.fy,
        );
        let p = k.undistort(distorted);
        let local = Vec3::new(p.x as f32, -p.y as f32, -1.0);
        Ray::new(self.center, (self.rotation * local).normalize_or_zero())
    }

    /// The image position of a point in pixels from the top-left corner; `None` behind the camera and outside the image.
    #[inline]
    pub fn project(&self, point: Vec3) -> Option<Vec2> {
        let local = self.rotation.transpose() * (point - self.center);
        let depth = -local.z;
        if depth <= 0.0 {
            return None;
        }
        let k = &self.intrinsics;
        let p = k.distort(DVec2::new(
            f64::from(local.x / depth),
            f64::from(-local.y / depth),
        ))?;
        let pixel = Vec2::new((p.x * k.fx + k.cx) as f32, (p.y * k.fy + k.cy) as f32);
        let inside = pixel.x >= 0.0
            && pixel.y >= 0.0
            && pixel.x < k.width as f32
            && pixel.y < k.height as f32;
        inside.then_some(pixel)
    }

    /// The camera with its picture downscaled to a long side of at most `long_side` pixels.
    pub fn shrunk(&self, long_side: u32) -> Self {
        let k = &self.intrinsics;
        let factor = f64::from(long_side.max(1)) / f64::from(k.width.max(k.height).max(1));
        if factor >= 1.0 {
            return self.clone();
        }
        let width = ((f64::from(k.width) * factor).round() as u32).max(1);
        let height = ((f64::from(k.height) * factor).round() as u32).max(1);
        let sx = f64::from(width) / f64::from(k.width);
        let sy = f64::from(height) / f64::from(k.height);
        let mut camera = self.clone();
        let k = &mut camera.intrinsics;
        (k.width, k.height) = (width, height);
        (k.fx, k.cx) = (k.fx * sx, k.cx * sx);
        (k.fy, k.cy) = (k.fy * sy, k.cy * sy);
        camera
    }

    /// Unit viewing direction.
    pub fn forward(&self) -> Vec3 {
        -self.rotation.z_axis
    }
}
