//! Feature buffers of the denoisers: what each pixel sees.

use crate::scene::camera::Camera;
use crate::scene::geometry::Ray;
use crate::transport::world::World;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// The features of a pixel: what it sees at one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Guide {
    /// Surface point in scene coordinates.
    pub point: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// Distance from the camera in metres.
    pub depth: f32,
    /// Diffuse reflectance.
    pub albedo: Vec3,
    /// Emitted radiance towards the camera.
    pub emission: Vec3,
    /// Object index.
    pub object: u32,
}

/// Lower limit of the albedo in the demodulation.
const MIN_ALBEDO: f32 = 0.02;

impl Guide {
    /// Light of a radiance: what is not emitted, over the albedo.
    pub fn demodulated(&self, radiance: Vec3) -> Vec3 {
        (radiance - self.emission) / self.albedo.max(Vec3::splat(MIN_ALBEDO))
    }

    /// Radiance of a light: the inverse of [`Guide::demodulated`].
    pub fn modulated(&self, light: Vec3) -> Vec3 {
        light * self.albedo.max(Vec3::splat(MIN_ALBEDO)) + self.emission
    }
}

/// Candidate positions in a pixel: its centre, then a ring.
const OFFSETS: [[f32; 2]; 9] = [
    [0.5, 0.5],
    [0.25, 0.25],
    [0.75, 0.75],
    [0.75, 0.25],
    [0.25, 0.75],
    [0.5, 0.1],
    [0.5, 0.9],
    [0.1, 0.5],
    [0.9, 0.5],
];

/// Positions in a pixel that its albedo is averaged over, besides the chosen one.
const AROUND: [[f32; 2]; 4] = [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]];

/// The features of all pixels of a camera at their centres. Albedo is averaged over the part of the pixel on the same object.
pub fn guides(world: &impl World, camera: &Camera) -> Vec<Option<Guide>> {
    guides_where(world, camera, |_, _| true)
}

/// [`guides`] with the albedo at each pixel's centre: a fifth of the rays.
pub fn guides_at_centers(world: &impl World, camera: &Camera) -> Vec<Option<Guide>> {
    guides_of(world, camera, &[], |_, _| true)
}

/// [`guides`] at the first of a few points of each pixel whose ray satisfies `wanted`.
pub fn guides_where(
    world: &impl World,
    camera: &Camera,
    wanted: impl Fn(usize, &Ray) -> bool + Sync,
) -> Vec<Option<Guide>> {
    guides_of(world, camera, &AROUND, wanted)
}

/// The features of all pixels along their first ray that satisfies `wanted`, with albedo averaged over more positions in the pixel.
fn guides_of(
    world: &impl World,
    camera: &Camera,
    around: &[[f32; 2]],
    wanted: impl Fn(usize, &Ray) -> bool + Sync,
) -> Vec<Option<Guide>> {
    let guide = |pixel: usize| {
        let ray_at = |offset: [f32; 2]| camera.ray(camera.corner(pixel) + Vec2::from(offset));
        let mut rays = OFFSETS.into_iter().map(ray_at);
        let ray = rays.find(|ray| wanted(pixel, ray))?;
        let seen = world.intersect(&ray)?;
        let towards = -ray.direction.normalize_or_zero();
        let front = seen.normal.dot(towards) > 0.0;
        let (mut albedo, mut taps) = (seen.albedo, 1.0);
        for &offset in around {
            let beside = world.intersect(&ray_at(offset));
            if let Some(beside) = beside.filter(|b| b.object == seen.object) {
                albedo += beside.albedo;
                taps += 1.0;
            }
        }
        let normal = if front {
            seen.shading_normal
        } else {
            -seen.shading_normal
        };
        Some(Guide {
            point: seen.point,
            normal,
            depth: seen.point.distance(camera.center),
            albedo: albedo / taps,
            emission: if front { seen.emission } else { Vec3::ZERO },
            object: seen.object,
        })
    };
    (0..camera.pixels()).into_par_iter().map(guide).collect()
}
