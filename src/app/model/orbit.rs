//! The 3D view's camera: turns about a point, pans, flies, and zooms to what is under the pointer.

use crate::capture::camera::Intrinsics;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use glam::{Mat3, Mat4, Vec2, Vec3};

/// A perspective camera looking at a point.
#[derive(Debug, Clone, PartialEq)]
pub struct Orbit {
    /// What it turns about, in scene coordinates.
    pub target: Vec3,
    /// Distance to the target; zero before the first scene.
    pub distance: f32,
    /// Angle about the up axis, radians.
    pub yaw: f32,
    /// Angle above the horizon of the viewing direction, radians.
    pub pitch: f32,
    /// Vertical field of view, radians.
    pub fov: f32,
    /// The scene's unit up vector.
    pub up: Vec3,
    /// Size of the view in pixels.
    pub size: Vec2,
}

impl Default for Orbit {
    fn default() -> Self {
        Self {
            target: Vec3::ZERO,
            distance: 0.0,
            yaw: 0.7,
            pitch: -0.5,
            fov: 50f32.to_radians(),
            up: Vec3::Y,
            size: Vec2::new(4.0, 3.0),
        }
    }
}

/// Furthest from the horizon, so that up stays up.
const MAX_PITCH: f32 = 1.54;

impl Orbit {
    /// East and north, at right angles to up.
    fn horizon(&self) -> (Vec3, Vec3) {
        let east = self.up.any_orthonormal_vector();
        (east, self.up.cross(east))
    }

    /// Unit viewing direction.
    pub fn forward(&self) -> Vec3 {
        let (east, north) = self.horizon();
        let level = east * self.yaw.cos() + north * self.yaw.sin();
        level * self.pitch.cos() + self.up * self.pitch.sin()
    }

    /// Centre of projection.
    pub fn eye(&self) -> Vec3 {
        self.target - self.forward() * self.distance
    }

    /// Columns are right, up and backwards.
    fn rotation(&self) -> Mat3 {
        let forward = self.forward();
        let right = forward.cross(self.up).normalize_or_zero();
        Mat3::from_cols(right, right.cross(forward), -forward)
    }

    /// Scene to clip space, depth 1 at the near plane and 0 at infinity.
    pub fn clip_from_scene(&self, scene: &Scene) -> Mat4 {
        let rotation = self.rotation();
        let view = Mat4::from_mat3(rotation.transpose()) * Mat4::from_translation(-self.eye());
        let near = (scene.diameter * 1e-3)
            .min(self.distance * 0.05)
            .max(f32::MIN_POSITIVE);
        let focal = 1.0 / (self.fov * 0.5).tan();
        let projection = Mat4::from_cols_array_2d(&[
            [focal * self.size.y / self.size.x, 0.0, 0.0, 0.0],
            [0.0, focal, 0.0, 0.0],
            [0.0, 0.0, 0.0, -1.0],
            [0.0, 0.0, near, 0.0],
        ]);
        projection * view
    }

    /// The same view as a camera to render from.
    pub fn camera(&self) -> Camera {
        let size = self.size.max(Vec2::ONE).round();
        let focal = f64::from(size.y) * 0.5 / f64::from(self.fov * 0.5).tan();
        Camera {
            intrinsics: Intrinsics {
                width: size.x as u32,
                height: size.y as u32,
                fx: focal,
                fy: focal,
                cx: f64::from(size.x) * 0.5,
                cy: f64::from(size.y) * 0.5,
                distortion: [0.0; 4],
            },
            rotation: self.rotation(),
            center: self.eye(),
        }
    }

    /// Turns by a drag of `delta` pixels; half the view's height is a right angle.
    pub fn turn(&mut self, delta: Vec2) {
        let angle = std::f32::consts::PI / self.size.y.max(1.0);
        self.yaw -= delta.x * angle;
        self.pitch = (self.pitch - delta.y * angle).clamp(-MAX_PITCH, MAX_PITCH);
    }

    /// Moves the scene with the pointer by `delta` pixels, at the target's depth.
    pub fn pan(&mut self, delta: Vec2) {
        let metres = 2.0 * (self.fov * 0.5).tan() * self.distance / self.size.y.max(1.0);
        let rotation = self.rotation();
        self.target += (rotation.y_axis * delta.y - rotation.x_axis * delta.x) * metres;
    }

    /// Moves eye and target by `steps` along right, up and forward.
    pub fn fly(&mut self, steps: Vec3) {
        let rotation = self.rotation();
        self.target += rotation.x_axis * steps.x + self.up * steps.y - rotation.z_axis * steps.z;
    }

    /// Scales the distance to `point` by `factor`, which stays where it is on the screen.
    pub fn zoom_to(&mut self, point: Vec3, factor: f32, scene: &Scene) {
        let least = scene.diameter * 1e-4;
        let factor = factor.max(least / self.distance.max(least));
        self.target = point + (self.target - point) * factor;
        self.distance *= factor;
    }

    /// Looks at an object from outside, or at the whole scene.
    pub fn frame(&mut self, scene: &Scene, object: Option<u32>) {
        let object = object.and_then(|object| scene.objects.get(object as usize));
        let corners: Vec<Vec3> = match object.map(|object| &object.triangles) {
            Some(triangles) => triangles.iter().flat_map(|&t| scene.corners(t)).collect(),
            None => scene.positions.clone(),
        };
        if corners.is_empty() {
            return;
        }
        // Scans have stray triangles far out: one corner in a hundred at each end of an axis is left out.
        let stray = (corners.len() - 1) / 100;
        let [mut low, mut high] = [Vec3::ZERO; 2];
        for axis in 0..3 {
            let mut along: Vec<f32> = corners.iter().map(|corner| corner[axis]).collect();
            along.sort_unstable_by(f32::total_cmp);
            (low[axis], high[axis]) = (along[stray], along[along.len() - 1 - stray]);
        }
        let radius = ((high - low).length() * 0.5).max(scene.diameter * 1e-3);
        self.up = scene.up;
        self.target = (low + high) * 0.5;
        self.distance = radius / (self.fov * 0.5).tan();
    }

    /// Takes over a photograph's camera, turning about what it sees in its middle.
    pub fn take_camera(&mut self, scene: &Scene, camera: &Camera) {
        let k = &camera.intrinsics;
        let middle = Vec2::new(k.width as f32, k.height as f32) * 0.5;
        let distance = scene
            .intersect(&camera.ray(middle))
            .map_or(scene.diameter * 0.3, |hit| hit.t);
        self.up = scene.up;
        let (east, north) = self.horizon();
        let forward = camera.forward();
        self.yaw = forward.dot(north).atan2(forward.dot(east));
        let pitch = forward.dot(self.up).clamp(-1.0, 1.0).asin();
        self.pitch = pitch.clamp(-MAX_PITCH, MAX_PITCH);
        self.fov = 2.0 * (f64::from(k.height) * 0.5 / k.fy).atan() as f32;
        self.distance = distance;
        self.target = camera.center + self.forward() * distance;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::app::model::tests::scene;
    use std::sync::Arc;

    fn on_screen(orbit: &Orbit, scene: &Scene, point: Vec3) -> Vec2 {
        let clip = orbit.clip_from_scene(scene) * point.extend(1.0);
        Vec2::new(0.5 + 0.5 * clip.x / clip.w, 0.5 - 0.5 * clip.y / clip.w) * orbit.size
    }

    fn framed() -> (Arc<Scene>, Orbit) {
        let scene = scene();
        let mut orbit = Orbit {
            size: Vec2::new(400.0, 300.0),
            ..Orbit::default()
        };
        orbit.frame(&scene, None);
        (scene, orbit)
    }

    #[test]
    fn the_drawn_and_the_rendered_camera_agree() {
        let (scene, orbit) = framed();
        let camera = orbit.camera();
        let pixels: Vec<(Vec3, Vec2)> = (scene.positions.iter())
            .filter_map(|&point| Some((point, camera.project(point)?)))
            .collect();
        assert!(
            pixels.len() >= 4,
            "most of what is framed is in the picture"
        );
        for (point, pixel) in pixels {
            assert!((pixel - on_screen(&orbit, &scene, point)).length() < 0.05);
        }
    }

    #[test]
    fn zooming_keeps_the_point_and_halves_its_distance() {
        let (scene, mut orbit) = framed();
        let point = scene.positions[0];
        let before = on_screen(&orbit, &scene, point);
        let distance = point.distance(orbit.eye());
        orbit.zoom_to(point, 0.5, &scene);
        assert!((on_screen(&orbit, &scene, point) - before).length() < 0.05);
        assert!((point.distance(orbit.eye()) / distance - 0.5).abs() < 1e-4);
    }

    #[test]
    fn panning_follows_the_pointer_and_turning_keeps_the_target() {
        let (scene, mut orbit) = framed();
        let target = orbit.target;
        orbit.turn(Vec2::new(31.0, -17.0));
        assert!((on_screen(&orbit, &scene, target) - orbit.size * 0.5).length() < 0.05);
        orbit.pan(Vec2::new(20.0, 10.0));
        let moved = on_screen(&orbit, &scene, target) - orbit.size * 0.5;
        assert!((moved - Vec2::new(20.0, 10.0)).length() < 0.1);
    }

    #[test]
    fn a_photographs_camera_is_taken_over() {
        let (scene, mut orbit) = framed();
        let camera = scene.cameras[0].clone();
        orbit.take_camera(&scene, &camera);
        assert!(orbit.eye().distance(camera.center) < 1e-4 * scene.diameter);
        assert!(orbit.forward().distance(camera.forward()) < 1e-4);
    }
}
