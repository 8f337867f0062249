//! A depth image and its photograph, looked up by points in space.

use crate::capture::camera::Pose;
use crate::capture::orientation::Orientation;
use crate::capture::photograph::Photograph;
use crate::capture::read::image;
use crate::capture::scan::{ImportedFrame, Lens};
use crate::error::{Error, Result};
use glam::{DVec2, DVec3, Vec3};

/// Relative difference above which neighbouring depths lie on different surfaces.
const JUMP: f32 = 0.05;

/// A decoded frame.
#[derive(Debug)]
pub struct View {
    /// Camera to world.
    pub pose: Pose,
    /// The depth camera.
    pub lens: Lens,
    /// Metres along the viewing direction; 0 where nothing was measured.
    pub depth: Vec<f32>,
    color_lens: Lens,
    photograph: Photograph,
}

impl View {
    /// Decodes a frame that has depth.
    ///
    /// # Errors
    /// There is no depth, or an image is broken.
    pub fn load(frame: &ImportedFrame) -> Result<Self> {
        let Some(depth) = &frame.depth else {
            return Err(Error::file(&frame.photograph, "has no depth image", ""));
        };
        let (photograph, _) = image::read(
            &frame.photograph,
            Orientation::default(),
            &frame.lens.pinhole,
            frame.exposure,
        )?;
        Ok(Self {
            pose: frame.pose,
            lens: depth.lens,
            depth: depth.metres()?,
            color_lens: frame.lens,
            photograph,
        })
    }

    /// A world point in camera coordinates: x right, y down, z forwards.
    pub fn to_camera(&self, point: DVec3) -> DVec3 {
        let p = self.pose.rotation.transpose() * (point - self.pose.center);
        DVec3::new(p.x, -p.y, -p.z)
    }

    /// A point in camera coordinates in the world.
    pub fn to_world(&self, p: DVec3) -> DVec3 {
        self.pose.rotation * DVec3::new(p.x, -p.y, -p.z) + self.pose.center
    }

    /// The measured depth in metres at a pixel position. Inverse depth is interpolated bilinearly, which is exact for planes;
    /// at depth discontinuities and next to missing depth the nearest pixel is used.
    pub fn depth_at(&self, pixel: DVec2) -> Option<f32> {
        let k = &self.lens.pinhole;
        let nearest = self.depth_of_pixel(pixel.x.floor() as i64, pixel.y.floor() as i64)?;
        let corner = pixel - DVec2::splat(0.5);
        let (i, j) = (corner.x.floor(), corner.y.floor());
        let (u, v) = ((corner.x - i) as f32, (corner.y - j) as f32);
        let (i, j) = (i as i64, j as i64);
        if i < 0 || j < 0 || i + 1 >= i64::from(k.width) || j + 1 >= i64::from(k.height) {
            return Some(nearest);
        }
        let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| self.depth_of_pixel(i + x, j + y));
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

    fn depth_of_pixel(&self, i: i64, j: i64) -> Option<f32> {
        let k = &self.lens.pinhole;
        let inside = i >= 0 && j >= 0 && i < i64::from(k.width) && j < i64::from(k.height);
        let depth = inside.then(|| self.depth[(j * i64::from(k.width) + i) as usize])?;
        (depth > 0.0).then_some(depth)
    }

    /// The photograph's linear colour at a point in camera coordinates; `None` outside it and at unusable pixels.
    pub fn color_at(&self, point: DVec3) -> Option<Vec3> {
        let pixel = self.color_lens.project(point)?.floor();
        let (width, height) = (self.photograph.width, self.photograph.height);
        let inside = pixel.x >= 0.0
            && pixel.y >= 0.0
            && pixel.x < f64::from(width)
            && pixel.y < f64::from(height);
        if !inside {
            return None;
        }
        let index = pixel.y as usize * width as usize + pixel.x as usize;
        let usable = self.photograph.is_usable(index);
        usable.then(|| self.photograph.pixels[index])
    }
}
