//! What the photographs see: id buffers, seen sides of objects, and the seen fraction of the mesh's area.

use crate::math::cumulative::Cumulative;
use crate::math::rng::Stream;
use crate::math::warp::uniform_triangle;
use crate::scene::Scene;
use crate::scene::camera::Camera;
use crate::scene::geometry::Ray;
use glam::Vec3;
use rayon::prelude::*;

/// Marks pixels that see no triangle.
pub const NOTHING: u32 = u32::MAX;

/// The triangle seen by the centre of each pixel.
#[derive(Debug, Clone)]
pub struct IdBuffers {
    /// For each frame, row by row from the top left, a triangle's index or [`NOTHING`].
    pub triangles: Vec<Vec<u32>>,
    /// For each object, the number of pixels that see its front.
    pub front_pixels: Vec<u64>,
    /// For each object, the number of pixels that see its back.
    pub back_pixels: Vec<u64>,
}

impl Scene {
    /// The id buffers of all cameras, computed at the first call.
    pub fn ids(&self) -> &IdBuffers {
        self.ids.get_or_init(|| IdBuffers::new(self))
    }

    /// The triangle that the centre of each pixel of a camera sees, row by row from the top left, or [`NOTHING`].
    pub fn seen_by(&self, camera: &Camera) -> Vec<u32> {
        let seen = |pixel| {
            let hit = self.intersect(&camera.ray(camera.corner(pixel) + 0.5));
            hit.map_or(NOTHING, |hit| hit.triangle)
        };
        (0..camera.pixels()).into_par_iter().map(seen).collect()
    }
}

impl IdBuffers {
    /// Casts one ray through the centre of every pixel of every camera.
    pub fn new(scene: &Scene) -> Self {
        let cameras = scene.cameras.iter();
        let mut buffers = Self {
            triangles: cameras.map(|camera| scene.seen_by(camera)).collect(),
            front_pixels: Vec::new(),
            back_pixels: Vec::new(),
        };
        buffers.count_sides(scene);
        buffers
    }

    /// Recounts the seen sides, for a scene with changed windings.
    pub fn count_sides(&mut self, scene: &Scene) {
        self.front_pixels = vec![0; scene.objects.len()];
        self.back_pixels = vec![0; scene.objects.len()];
        for (camera, ids) in scene.cameras.iter().zip(&self.triangles) {
            for &triangle in ids.iter().filter(|&&t| t != NOTHING) {
                let [corner, _, _] = scene.corners(triangle);
                let towards = camera.center - corner;
                let object = scene.object_of[triangle as usize] as usize;
                let front = towards.dot(scene.normals[triangle as usize]) >= 0.0;
                let count = if front {
                    &mut self.front_pixels
                } else {
                    &mut self.back_pixels
                };
                count[object] += 1;
            }
        }
    }

    /// The number of pixels that see an object, from either side.
    pub fn seen_pixels(&self, object: usize) -> u64 {
        self.front_pixels[object] + self.back_pixels[object]
    }

    /// The number of pixels of a frame that see the mesh.
    pub fn pixels_on_mesh(&self, frame: usize) -> u64 {
        let seen = self.triangles[frame].iter().filter(|&&t| t != NOTHING);
        seen.count() as u64
    }
}

/// The fraction of the mesh's area that any camera sees, from either side, estimated from `samples` points.
///
/// Points are stratified by area and deterministic; the standard error is at most ½ / √samples.
pub fn seen_area_fraction(scene: &Scene, samples: u32) -> f64 {
    let areas = Cumulative::new(scene.areas.iter().map(|&area| f64::from(area)));
    if areas.total() <= 0.0 || samples == 0 {
        return 0.0;
    }
    let seen = (0..samples)
        .into_par_iter()
        .filter(|&sample| {
            let mut stream = Stream::new(0, 0, 0, u64::from(sample));
            let stratum = (f64::from(sample) + stream.uniform_f64()) / f64::from(samples);
            let Some(triangle) = areas.index_at(stratum * areas.total()) else {
                return false;
            };
            let triangle = triangle as u32;
            let [a, b, c] = scene.corners(triangle);
            let [u, v] = uniform_triangle(stream.uniform2());
            let point = a * (1.0 - u - v) + b * u + c * v;
            (scene.cameras.iter()).any(|camera| sees(scene, camera, point, triangle))
        })
        .count();
    seen as f64 / f64::from(samples)
}

/// Whether a camera sees a point of a triangle.
fn sees(scene: &Scene, camera: &Camera, point: Vec3, triangle: u32) -> bool {
    if camera.project(point).is_none() {
        return false;
    }
    let ray = Ray::new(camera.center, point - camera.center);
    scene
        .intersect(&ray)
        .is_some_and(|hit| hit.triangle == triangle || hit.t >= 1.0 - 1e-4)
}
