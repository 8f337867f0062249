//! Accumulates path samples into pictures; a pixel is the box-filtered mean of radiance over its area.

use crate::math::rng::Stream;
use crate::scene::camera::Camera;
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
            sums: vec![DVec3::ZERO; width as usize * height as usize],
            rays: 0,
            rejected: 0,
        }
    }

    /// Adds `samples` paths to every pixel. Streams are keyed by (seed, frame, pixel, sample), so the result does not depend on
    /// threads or on the split over calls.
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
        self.trace(world, camera, options, (seed, frame), rows, samples);
        self.samples += samples;
    }

    /// Adds one path to each pixel of some rows, keyed as in [`Film::add`]. The call with the last row increments the number of
    /// samples; until then [`Film::mean`] is invalid.
    pub fn add_rows(
        &mut self,
        world: &impl World,
        camera: &Camera,
        options: &PathOptions,
        key: (u64, u64),
        rows: Range<u32>,
    ) {
        let last = rows.end >= self.height;
        self.trace(world, camera, options, key, rows, 1);
        self.samples += u32::from(last);
    }

    fn trace(
        &mut self,
        world: &impl World,
        camera: &Camera,
        options: &PathOptions,
        (seed, frame): (u64, u64),
        rows: Range<u32>,
        samples: u32,
    ) {
        let first = self.samples;
        let width = self.width as usize;
        let top = rows.start as usize;
        let pixels = top * width..rows.end.min(self.height) as usize * width;
        let counts: Vec<(u64, u64)> = self.sums[pixels]
            .par_chunks_mut(width.max(1))
            .enumerate()
            .map(|(row, sums)| {
                let row = top + row;
                let (mut rays, mut rejected) = (0, 0);
                for (column, sum) in sums.iter_mut().enumerate() {
                    let pixel = (row * width + column) as u64;
                    for index in first..first + samples {
                        let mut stream = Stream::new(seed, frame, pixel, u64::from(index));
                        let [dx, dy] = stream.uniform2();
                        let ray = camera.ray(Vec2::new(column as f32 + dx, row as f32 + dy));
                        let sample = radiance(world, &ray, &mut stream, options);
                        *sum += sample.radiance.as_dvec3();
                        rays += u64::from(sample.rays);
                        rejected += u64::from(sample.rejected);
                    }
                }
                (rays, rejected)
            })
            .collect();
        self.rays += counts.iter().map(|c| c.0).sum::<u64>();
        self.rejected += counts.iter().map(|c| c.1).sum::<u64>();
    }

    /// Mean radiance of each pixel; zero before the first sample.
    pub fn mean(&self) -> Vec<Vec3> {
        let scale = if self.samples == 0 {
            0.0
        } else {
            1.0 / f64::from(self.samples)
        };
        self.sums.iter().map(|s| (*s * scale).as_vec3()).collect()
    }
}
