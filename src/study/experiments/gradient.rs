//! Noise of single-path derivatives.

use crate::calibrate::problem::Problem;
use crate::inverse::paths::derivative::{Gradient, differentiate};
use crate::inverse::paths::trace::Tracer;
use crate::inverse::settings::LightSampling;
use crate::inverse::unknowns::Unknowns;
use crate::math::rng::Stream;
use crate::math::stats::Moments;
use crate::scene::Scene;
use crate::transport::emitters::{Emitters, powers};
use crate::transport::material::Lobe;
use glam::Vec3;
use rayon::prelude::*;

/// Key of the paths; differs from those of solvers.
const KEY: u64 = 0x6772_6164;
/// Bounces, as in the paper.
const BOUNCES: u32 = 2;

/// Noise of the derivative of a pixel's radiance from one path.
#[derive(Debug, Clone, Copy)]
pub struct Noise {
    /// Variance between paths of a pixel, summed over unknowns and channels, averaged over pixels. Derivatives by emission are
    /// multiplied by its value, so that all are radiances.
    pub variance: f64,
    /// Its standard error over pixels.
    pub error: f64,
    /// Rays per path.
    pub rays: f64,
}

/// Measures the noise at given unknowns, with `paths` paths for each of `pixels` pixels spread evenly over all photographs. The
/// lobes, one per object, are constant.
pub fn noise(
    problem: &Problem,
    unknowns: &Unknowns,
    lobes: &[Option<Lobe>],
    sampling: LightSampling,
    pixels: usize,
    paths: u64,
) -> Noise {
    let scene = &*problem.scene;
    let lights = lamps(scene, &unknowns.emission);
    let believed = vec![1.0; unknowns.surfaces()];
    let tracer = Tracer {
        lobes,
        ..tracer(scene, &lights, &believed, sampling, BOUNCES)
    };
    let all: Vec<(usize, usize)> = (problem.photographs.iter().enumerate())
        .flat_map(|(frame, photograph)| {
            (0..photograph.pixels.len()).map(move |pixel| (frame, pixel))
        })
        .collect();
    let count = pixels.min(all.len());
    let found: Vec<(f64, u64)> = (0..count)
        .into_par_iter()
        .map(|index| {
            let (frame, pixel) = all[index * all.len() / count];
            of_pixel(problem, &tracer, unknowns, frame, pixel, paths)
        })
        .collect();
    let variance: Moments = found.iter().map(|(value, _)| *value).collect();
    let rays: u64 = found.iter().map(|(_, rays)| rays).sum();
    Noise {
        variance: variance.mean,
        error: variance.standard_error(),
        rays: rays as f64 / (count as u64 * paths).max(1) as f64,
    }
}

/// A tracer of paths with one surface per object, lit only by lamps of the mesh.
pub fn tracer<'a>(
    scene: &'a Scene,
    lights: &'a Emitters,
    expected_albedo: &'a [f32],
    sampling: LightSampling,
    max_bounces: u32,
) -> Tracer<'a> {
    Tracer {
        scene,
        lights,
        measured: None,
        surface_of: &scene.object_of,
        expected_albedo,
        texels: None,
        lobes: &[],
        patches: None,
        sky: None,
        outside: None,
        sampling,
        max_bounces,
        seed: KEY,
        stage: 0,
        round: 0,
    }
}

/// Emitters of the mesh, weighted by area × luminance.
pub fn lamps(scene: &Scene, emission: &[Vec3]) -> Emitters {
    Emitters::new(scene, &powers(scene, emission.iter().copied()))
}

/// Summed variance of a pixel's derivatives, and the rays cast.
fn of_pixel(
    problem: &Problem,
    tracer: &Tracer,
    unknowns: &Unknowns,
    frame: usize,
    pixel: usize,
    paths: u64,
) -> (f64, u64) {
    let camera = &problem.scene.cameras[frame];
    let corner = camera.corner(pixel);
    let parameters = 2 * unknowns.surfaces();
    let mut gradient = Gradient::new(parameters);
    let (mut vertices, mut gathered) = (Vec::new(), Vec::new());
    let mut moments = vec![[Moments::default(); 3]; parameters];
    let mut rays = 0;
    for path in 0..paths {
        let mut stream = Stream::new(KEY, frame as u64, pixel as u64, path);
        vertices.clear();
        let cast = tracer.pixel_path(camera, corner, &mut stream, &mut vertices);
        rays += cast.rays;
        gradient.clear();
        differentiate(&vertices, unknowns, &[], &mut gathered, &mut gradient);
        for (parameter, moments) in moments.iter_mut().enumerate() {
            let mut value = Vec3::from(gradient.values[parameter]);
            if parameter >= unknowns.surfaces() {
                value *= unknowns.value(parameter);
            }
            for (channel, moments) in moments.iter_mut().enumerate() {
                moments.push(f64::from(value[channel]));
            }
        }
    }
    (moments.iter().flatten().map(Moments::variance).sum(), rays)
}
