//! Accumulates path samples into pictures; a pixel is the box-filtered mean of radiance over its area.

use crate::math::picture::Picture;
use crate::math::rng::Stream;
use crate::scene::camera::Camera;
use crate::transport::arrival::RayCount;
use crate::transport::path::{PathOptions, radiance};
use crate::transport::world::World;
use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;
use std::ops::Range;

/// Sums of radiance over samples in f64, one per pixel.
#[derive(Debug, Clone)]
pub struct Film {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Samples per pixel so far.
    pub samples: u32,
    /// Sum of radiance over the samples of each pixel.
    pub sums: Vec<DVec3>,
    /// Rays cast.
    pub rays: u64,
    /// Samples dropped because they were not finite.
    pub rejected: u64,
}

impl Film {
    /// An empty film of a camera's size.
    pub fn new(camera: &Camera) -> Self {
        let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
        Self {
            width,
            height,
            samples: 0,
            sums: vec![DVec3::ZERO; camera.pixels()],
            rays: 0,
            rejected: 0,
        }
    }

    /// Adds `samples` paths to every pixel. Keyed by (seed, frame, pixel, sample), so that threads and calls do not matter.
    pub fn add(
        &mut self,
        world: &impl World,
        camera: &Camera,
        options: &PathOptions,
        seed: u64,
        frame: u64,
        samples: u32,
    ) {
        let rows = 0..self.height;
        self.add_rows(world, camera, options, (seed, frame), rows, samples);
    }

    /// Adds `samples` paths to each pixel of some rows, keyed as in [`Film::add`]. The call with the last row increases the number
    /// of samples; until then [`Film::mean`] is invalid.
    pub fn add_rows(
        &mut self,
        world: &impl World,
        camera: &Camera,
        options: &PathOptions,
        (seed, frame): (u64, u64),
        rows: Range<u32>,
        samples: u32,
    ) {
        let is_last = rows.end >= self.height;
        let first = self.samples;
        let width = self.width as usize;
        let pixels = rows.start as usize * width..rows.end.min(self.height) as usize * width;
        let add = |(sum, pixel): (&mut DVec3, usize)| {
            let mut cast = RayCount::default();
            for index in first..first + samples {
                let mut stream = Stream::new(seed, frame, pixel as u64, u64::from(index));
                let ray = camera.ray(camera.corner(pixel) + Vec2::from(stream.uniform2()));
                let sample = radiance(world, &ray, &mut stream, options);
                *sum += sample.radiance.as_dvec3();
                cast.rays += u64::from(sample.rays);
                cast.rejected += u64::from(sample.rejected);
            }
            cast
        };
        let sums = self.sums[pixels.clone()].par_iter_mut();
        let cast: RayCount = sums.zip(pixels).map(add).sum();
        self.rays += cast.rays;
        self.rejected += cast.rejected;
        self.samples += if is_last { samples } else { 0 };
    }

    /// Mean radiance as a picture; see [`Film::mean`].
    pub fn picture(&self) -> Picture {
        Picture {
            width: self.width,
            height: self.height,
            pixels: self.mean(),
        }
    }

    /// Mean radiance of each pixel; zero before the first sample.
    pub fn mean(&self) -> Vec<Vec3> {
        let scale = if self.samples == 0 {
            0.0
        } else {
            1.0 / f64::from(self.samples)
        };
        let means = self.sums.par_iter().map(|s| (*s * scale).as_vec3());
        means.collect()
    }
}
