//! Cameras in scene coordinates: pixel to ray, point to pixel.

use crate::capture::camera::{Intrinsics, Pose};
use crate::scene::geometry::Ray;
use glam::{DVec3, Mat3, Vec2, Vec3};
use nalgebra::Matrix3;

/// Greatest mean square of the cameras' rolls over that of their other turns at which they count as level: a tenth of the angle.
const MAX_ROLL: f64 = 0.01;
/// Least cosine between the level up axis and the mean one: 30°.
const MIN_LEVEL: f32 = 0.866;

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

/// The unit vector across the right axes of all cameras, since people hold cameras level, on the side of `up`. The mean of the
/// cameras' own up axes leans to where most of them look. `up` if the cameras are rolled, or the result is far from it.
pub fn level_up(cameras: &[Camera], up: Vec3) -> Vec3 {
    let sum: Matrix3<f64> = (cameras.iter())
        .map(|camera| camera.rotation.x_axis.as_dvec3())
        .map(|right| Matrix3::from_fn(|i, j| right[i] * right[j]))
        .sum();
    let axes = sum.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| axes.eigenvalues[*a].total_cmp(&axes.eigenvalues[*b]));
    let [least, middle, _] = order.map(|i| axes.eigenvalues[i].max(0.0));
    let across = axes.eigenvectors.column(order[0]);
    let level = DVec3::new(across[0], across[1], across[2]).as_vec3();
    let level = level * level.dot(up).signum();
    let is_level = middle > 0.0 && least <= MAX_ROLL * middle && level.dot(up) > MIN_LEVEL;
    if is_level { level } else { up }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cameras at the origin that look in directions, with a roll each in radians.
    fn looking<const N: usize>(views: [(Vec3, f32); N]) -> Vec<Camera> {
        let intrinsics = Intrinsics {
            width: 4,
            height: 3,
            fx: 4.0,
            fy: 4.0,
            cx: 2.0,
            cy: 1.5,
            distortion: [0.0; 4],
        };
        let camera = |(towards, roll): (Vec3, f32)| {
            let back = -towards.normalize();
            let right = Mat3::from_axis_angle(back, roll) * Vec3::Y.cross(back).normalize();
            Camera {
                intrinsics,
                rotation: Mat3::from_cols(right, back.cross(right), back),
                center: Vec3::ZERO,
            }
        };
        views.map(camera).to_vec()
    }

    #[test]
    fn cameras_that_look_down_one_way_are_level_all_the_same() {
        let down = |x: f32| Vec3::new(x, -0.6, -1.0);
        let mean = |cameras: &[Camera]| {
            let sum: Vec3 = cameras.iter().map(|camera| camera.rotation.y_axis).sum();
            sum.normalize()
        };
        let level = looking([(down(0.0), 0.0), (down(0.7), 0.0), (down(-0.4), 0.0)]);
        assert!(mean(&level).dot(Vec3::Y) < 0.9);
        assert!(level_up(&level, mean(&level)).dot(Vec3::Y) > 1.0 - 1e-6);
        // Rolled cameras, and all looking one way, tell no more than their mean.
        let rolled = looking([(down(0.0), 0.5), (down(0.7), -0.4), (down(-0.4), 0.2)]);
        assert_eq!(level_up(&rolled, Vec3::Y), Vec3::Y);
        let alike = looking([(down(0.0), 0.0), (down(0.0), 0.0)]);
        assert_eq!(level_up(&alike, mean(&alike)), mean(&alike));
        assert_eq!(level_up(&[], Vec3::Z), Vec3::Z);
    }
}
