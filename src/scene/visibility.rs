//! What the photographs see: id buffers, seen sides of objects, and the seen fraction of the mesh's area.

use crate::math::rng::Stream;
use crate::scene::Scene;
use crate::scene::geometry::Ray;
pub use crate::scene::ids::{IdBuffers, NOTHING};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

impl Scene {
    /// The id buffers of all cameras, computed at the first call.
    pub fn ids(&self) -> &IdBuffers {
        self.ids.get_or_init(|| IdBuffers::new(self))
    }
}

impl IdBuffers {
    /// Casts one ray through the centre of every pixel of every camera.
    pub fn new(scene: &Scene) -> Self {
        let triangles: Vec<Vec<u32>> = scene
            .cameras
            .iter()
            .map(|camera| {
                let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
                (0..height)
                    .into_par_iter()
                    .flat_map_iter(|y| (0..width).map(move |x| (x, y)))
                    .map(|(x, y)| {
                        let ray = camera.ray(Vec2::new(x as f32 + 0.5, y as f32 + 0.5));
                        scene.intersect(&ray).map_or(NOTHING, |hit| hit.triangle)
                    })
                    .collect()
            })
            .collect();
        let mut buffers = Self {
            triangles,
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
}

/// The fraction of the mesh's area that any camera sees, from either side, estimated from `samples` points.
///
/// Points are stratified by area and deterministic; the standard error is at most ½ / √samples.
pub fn seen_area_fraction(scene: &Scene, samples: u32) -> f64 {
    let mut sum = 0.0;
    let cumulative: Vec<f64> = scene
        .areas
        .iter()
        .map(|&area| {
            sum += f64::from(area);
            sum
        })
        .collect();
    if sum <= 0.0 || samples == 0 {
        return 0.0;
    }
    let seen = (0..samples)
        .into_par_iter()
        .filter(|&sample| {
            let mut stream = Stream::new(0, 0, 0, u64::from(sample));
            let target = (f64::from(sample) + stream.uniform_f64()) / f64::from(samples) * sum;
            let triangle = cumulative
                .partition_point(|&c| c <= target)
                .min(cumulative.len() - 1) as u32;
            let [a, b, c] = scene.corners(triangle);
            let [u, v] = crate::math::warp::uniform_triangle(stream.uniform2());
            let point = a * (1.0 - u - v) + b * u + c * v;
            (0..scene.cameras.len()).any(|camera| sees(scene, camera, point, triangle))
        })
        .count();
    seen as f64 / f64::from(samples)
}

/// Whether a camera sees a point of a triangle.
fn sees(scene: &Scene, camera: usize, point: Vec3, triangle: u32) -> bool {
    let camera = &scene.cameras[camera];
    if camera.project(point).is_none() {
        return false;
    }
    let ray = Ray::new(camera.center, point - camera.center);
    scene
        .intersect(&ray)
        .is_some_and(|hit| hit.triangle == triangle || hit.t >= 1.0 - 1e-4)
}
