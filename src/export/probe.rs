//! Light probes: the light at a point as a panorama.

use crate::error::{Error, Result};
use crate::export::atomic::write_atomically;
use crate::export::exr::{Precision, write_rgb};
use crate::math::picture::Picture;
use crate::math::rng::Stream;
use crate::scene::geometry::Ray;
use crate::transport::lit::LitScene;
use crate::transport::path::{PathOptions, radiance};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::f32::consts::PI;
use std::path::Path;

/// Rows of a written panorama; it has twice as many columns.
const HEIGHT: u32 = 128;
/// Samples per pixel of a written panorama.
const SAMPLES: u32 = 64;

/// Writes the radiance that arrives at a point of the capture as an equirectangular panorama (.exr or .hdr).
///
/// # Errors
/// The file cannot be written or has another extension, or the point is not finite.
pub fn write(path: &Path, world: &LitScene, at: DVec3) -> Result<()> {
    if !at.is_finite() {
        let problem = "is no point";
        let remedy = "give x,y,z in the capture's coordinates";
        return Err(Error::usage("--at", problem, remedy));
    }
    let point = (at - world.scene.origin).as_vec3();
    let picture = || panorama(world, point, HEIGHT, SAMPLES, 1);
    match path.extension().and_then(|e| e.to_str()) {
        Some("exr") => write_rgb(path, &picture(), Precision::Float),
        Some("hdr") => {
            let picture = picture();
            let (width, height) = (picture.width as usize, picture.height as usize);
            let pixels = picture.pixels.iter().map(|c| image::Rgb(c.to_array()));
            let pixels: Vec<image::Rgb<f32>> = pixels.collect();
            write_atomically(path, |out| {
                Ok(image::codecs::hdr::HdrEncoder::new(out).encode(&pixels, width, height)?)
            })
        }
        _ => {
            let problem = "a panorama is written as .exr or .hdr";
            Err(Error::file(path, problem, "change the ending"))
        }
    }
}

/// Radiance arriving at a point in scene coordinates from all directions, averaged over each pixel.
///
/// Row 0 is around +y and columns turn from +x to +z, as in [`crate::transport::environment::Environment`].
pub fn panorama(world: &LitScene, point: Vec3, height: u32, samples: u32, seed: u64) -> Picture {
    let width = 2 * height;
    let options = PathOptions::default();
    let pixels = (0..width * height)
        .into_par_iter()
        .map(|pixel| {
            let (row, column) = (pixel / width, pixel % width);
            let mut sum = DVec3::ZERO;
            for index in 0..samples {
                let mut stream = Stream::new(seed, 0, u64::from(pixel), u64::from(index));
                let [u, v] = stream.uniform2();
                let theta = PI * (row as f32 + v) / height as f32;
                let phi = 2.0 * PI * (column as f32 + u) / width as f32;
                let (sin, cos) = (theta.sin(), theta.cos());
                let direction = Vec3::new(sin * phi.cos(), cos, sin * phi.sin());
                let ray = Ray::new(point, direction);
                let sample = radiance(world, &ray, &mut stream, &options);
                sum += sample.radiance.as_dvec3();
            }
            (sum / f64::from(samples.max(1))).as_vec3()
        })
        .collect();
    Picture {
        width,
        height,
        pixels,
    }
}
