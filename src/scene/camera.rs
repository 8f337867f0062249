//! Cameras in scene coordinates: pixel to ray, point to pixel.

use crate::capture::camera::{Intrinsics, Pose};
use crate::scene::geometry::Ray;
use glam::{DVec3, Mat3, Vec2, Vec3};

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

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.intrinsics.width as usize * self.intrinsics.height as usize
    }

    /// The top-left corner of a pixel; pixels are counted row by row.
    #[inline]
    pub fn corner(&self, pixel: usize) -> Vec2 {
        let width = self.intrinsics.width as usize;
        Vec2::new((pixel % width) as f32, (pixel / width) as f32)
    }

    /// The ray through a point of the image plane in pixels from the top-left corner; its direction has unit length.
    #[inline]
    pub fn ray(&self, pixel: Vec2) -> Ray {
        let k = &self.intrinsics;
        let p = k.undistort(k.normalized(pixel.as_dvec2()));
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
        let p = k.distort(Vec2::new(local.x / depth, -local.y / depth).as_dvec2())?;
        let pixel = k.pixel(p).as_vec2();
        let far = Vec2::new(k.width as f32, k.height as f32);
        let inside = pixel.cmpge(Vec2::ZERO) & pixel.cmplt(far);
        inside.all().then_some(pixel)
    }

    /// The camera with its picture downscaled to a long side of at most `long_side` pixels.
    pub fn shrunk(&self, long_side: u32) -> Self {
        let k = &self.intrinsics;
        let factor = f64::from(long_side.max(1)) / f64::from(k.width.max(k.height).max(1));
        if factor >= 1.0 {
            return self.clone();
        }
        let size = [k.width, k.height];
        let size = size.map(|side| ((f64::from(side) * factor).round() as u32).max(1));
        Self {
            intrinsics: k.resized(size),
            ..*self
        }
    }

    /// Unit viewing direction.
    pub fn forward(&self) -> Vec3 {
        -self.rotation.z_axis
    }
}
