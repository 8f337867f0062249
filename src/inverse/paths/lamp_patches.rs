//! Reflected radiance of lamps per triangle ("patch"), for an albedo of one.
//!
//! A lamp's albedo adds little to its radiance, by an amount that varies over the lamp. Following paths beyond lamps would estimate
//! it with too much noise. It is instead traced once from each patch and looked up wherever a light sample or a path reaches one.

use crate::inverse::paths::NO_PATCH;
use crate::inverse::roles::Role;
use crate::math::rng::Stream;
use crate::math::warp;
use crate::scene::Scene;
use crate::scene::geometry::Hit;
use crate::transport::arrival::RayCount;
use crate::transport::lit::LitScene;
use crate::transport::path::{PathOptions, white_radiance};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Least and greatest number of paths per patch; the least one if the total allows it.
const PATHS: [f64; 2] = [4.0, 1024.0];
const KEY: u64 = 0x7061_7463;

/// The triangles of all lamps.
#[derive(Debug, Default)]
pub struct LampPatches {
    /// Triangle of each patch.
    triangles: Vec<u32>,
    /// Patch of each triangle of the scene, or [`NO_PATCH`]; empty without lamps.
    patch_of: Vec<u32>,
    /// Mean radiance that each patch would reflect from its front with an albedo of one (irradiance / π); set by `light`.
    pub reflected: Vec<Vec3>,
}

impl LampPatches {
    /// The triangles of objects with the role [`Role::Emitter`].
    pub fn new(scene: &Scene, roles: &[Role]) -> Self {
        let lamps = scene.objects.iter().zip(roles);
        let triangles: Vec<u32> = lamps
            .filter(|(_, role)| **role == Role::Emitter)
            .flat_map(|(object, _)| object.triangles.iter().copied())
            .collect();
        let mut patch_of = Vec::new();
        if !triangles.is_empty() {
            patch_of.resize(scene.triangles.len(), NO_PATCH);
        }
        for (patch, &triangle) in (0..).zip(&triangles) {
            patch_of[triangle as usize] = patch;
        }
        Self {
            triangles,
            patch_of,
            reflected: Vec::new(),
        }
    }

    /// The patch of a triangle, or [`NO_PATCH`].
    pub fn patch(&self, triangle: u32) -> u32 {
        let patch = self.patch_of.get(triangle as usize);
        patch.copied().unwrap_or(NO_PATCH)
    }

    /// Estimates `reflected` with about `paths` paths, distributed in proportion to area, through the scene with its present
    /// estimate. Paths of different rounds are independent.
    pub fn light(
        &mut self,
        lit: &LitScene,
        paths: u64,
        options: &PathOptions,
        [seed, round]: [u64; 2],
    ) -> RayCount {
        let scene = &*lit.scene;
        let area: f64 = self.triangles.iter().map(|&t| area_of(scene, t)).sum();
        let even = paths as f64 / self.triangles.len() as f64;
        let min = even.clamp(1.0, PATHS[0]);
        let (reflected, casts): (_, Vec<RayCount>) = (self.triangles.par_iter())
            .map(|&triangle| {
                let fraction = paths as f64 * area_of(scene, triangle) / area;
                // `max` ignores the NaN of lamps without any area.
                let count = fraction.max(min).min(PATHS[1]) as u64;
                let (mut sum, mut cast) = (DVec3::ZERO, RayCount::default());
                for path in 0..count {
                    let mut stream = Stream::new(seed, KEY + round, u64::from(triangle), path);
                    let [b1, b2] = warp::uniform_triangle(stream.uniform2());
                    let hit = Hit {
                        t: 0.0,
                        triangle,
                        b1,
                        b2,
                    };
                    let normal = scene.normals[triangle as usize];
                    let surface = lit.surface(&hit);
                    let sample = white_radiance(lit, &surface, normal, &mut stream, options);
                    sum += sample.radiance.as_dvec3();
                    cast.rays += u64::from(sample.rays);
                    cast.rejected += u64::from(sample.rejected);
                }
                ((sum / count as f64).as_vec3(), cast)
            })
            .unzip();
        self.reflected = reflected;
        casts.into_iter().sum()
    }
}

fn area_of(scene: &Scene, triangle: u32) -> f64 {
    f64::from(scene.areas[triangle as usize])
}
