//! Paths evaluated in 32 bits, as in the fit, and in 64 bits.

use crate::calibrate::problem::Problem;
use crate::inverse::paths::derivative::{Gradient, differentiate};
use crate::inverse::paths::{NO_LAMP, Vertex};
use crate::inverse::settings::LightSampling;
use crate::inverse::unknowns::Unknowns;
use crate::math::rng::Stream;
use crate::study::experiments::gradient::tracer;
use crate::transport::emitters::Emitters;
use glam::Vec3;

const KEY: u64 = 0x7375_6d73;
const ALBEDO: f32 = 0.55;
/// Longest path in bounces.
const BOUNCES: u32 = 64;
/// Paths for comparing the light of two lamps.
const LAMP_PATHS: usize = 10_000;

/// Paths through the pixels of all photographs in turn. Two objects are lamps, sampled with equal probability.
pub struct Paths {
    vertices: Vec<Vertex>,
    path_ends: Vec<usize>,
    surfaces: usize,
    lamps: [usize; 2],
}

impl Paths {
    /// Traces `count` paths with two objects as lamps.
    pub fn trace(problem: &Problem, lamps: [usize; 2], count: usize) -> Self {
        let scene = &*problem.scene;
        let surfaces = scene.objects.len();
        let mut weights = vec![0.0; surfaces];
        lamps.iter().for_each(|&lamp| weights[lamp] = 1.0);
        let lights = Emitters::new(scene, &weights);
        let expected = vec![ALBEDO; surfaces];
        let tracer = tracer(scene, &lights, &expected, LightSampling::Mis, BOUNCES);
        let (mut vertices, mut path_ends) = (Vec::new(), Vec::new());
        for path in 0..count {
            let frame = path % scene.cameras.len().max(1);
            let camera = &scene.cameras[frame];
            let mut stream = Stream::new(KEY, frame as u64, 0, path as u64);
            let corner = camera.corner(stream.below(camera.pixels()));
            tracer.pixel_path(camera, corner, &mut stream, &mut vertices);
            path_ends.push(vertices.len());
        }
        Self {
            vertices,
            path_ends,
            surfaces,
            lamps,
        }
    }

    pub fn count(&self) -> usize {
        self.path_ends.len()
    }

    fn first(&self, count: usize) -> impl Iterator<Item = &[Vertex]> {
        let starts = std::iter::once(0).chain(self.path_ends.iter().copied());
        let ranges = starts.zip(&self.path_ends).take(count);
        ranges.map(|(start, &end)| &self.vertices[start..end])
    }

    /// Sum over the first `count` paths with lamps of radiance one, accumulated in 32 bits.
    pub fn in_f32(&self, count: usize) -> f64 {
        f64::from(self.radiances(count, [1.0, 1.0]).sum::<f32>())
    }

    /// The same, accumulated in 64 bits.
    pub fn in_f64(&self, count: usize) -> f64 {
        self.radiances(count, [1.0, 1.0]).map(f64::from).sum()
    }

    /// Relative error of a sum over the first `count` paths.
    pub fn error(&self, count: usize, sum: fn(&Self, usize) -> f64) -> f64 {
        let exact = self.exact(count, [1.0, 1.0]);
        (sum(self, count) / exact - 1.0).abs()
    }

    /// Relative error of the contribution of a lamp of radiance one beside a lamp of radiance `ratio`.
    pub fn dim_lamp_error(&self, ratio: f64) -> f64 {
        let sum =
            |lamps: [f32; 2]| -> f64 { self.radiances(LAMP_PATHS, lamps).map(f64::from).sum() };
        let found = sum([1.0, ratio as f32]) - sum([0.0, ratio as f32]);
        (found / self.exact(LAMP_PATHS, [1.0, 0.0]) - 1.0).abs()
    }

    /// Radiance of each path, in 32 bits.
    fn radiances(&self, count: usize, radiances: [f32; 2]) -> impl Iterator<Item = f32> {
        let mut unknowns = Unknowns {
            albedo: vec![Vec3::splat(ALBEDO); self.surfaces],
            emission: vec![Vec3::ZERO; self.surfaces],
        };
        for (lamp, radiance) in self.lamps.into_iter().zip(radiances) {
            unknowns.emission[lamp] = Vec3::splat(radiance);
        }
        let mut gathered = Vec::new();
        let mut gradient = Gradient::new(2 * self.surfaces);
        self.first(count).map(move |path| {
            gradient.clear();
            differentiate(path, &unknowns, &[], &mut gathered, &mut gradient).x
        })
    }

    /// Sum over paths, in 64 bits throughout, from the same weights.
    fn exact(&self, count: usize, radiances: [f64; 2]) -> f64 {
        let emission = |surface: u32| {
            let lamp = self.lamps.iter().position(|&l| l == surface as usize);
            lamp.map_or(0.0, |lamp| radiances[lamp])
        };
        let radiance = |path: &[Vertex]| {
            path.iter().rev().fold(0.0, |beyond, v| {
                let lamp = if v.lamp == NO_LAMP {
                    0.0
                } else {
                    emission(v.lamp) * f64::from(v.lamp_weight)
                };
                emission(v.surface) * f64::from(v.emission_weight)
                    + f64::from(ALBEDO) * (beyond + lamp)
            })
        };
        self.first(count).map(radiance).sum()
    }
}
