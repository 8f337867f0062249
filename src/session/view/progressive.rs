//! A render that sharpens a slice of rows at a time.

use crate::math::rng::Stream;
use crate::scene::camera::Camera;
use crate::session::snapshot::Picture;
use crate::transport::lit::Lit;
use crate::transport::path::{PathOptions, radiance};
use glam::{DVec3, Vec2};
use rayon::prelude::*;
use std::time::Instant;

/// Seconds that a slice should take.
const SLICE: f64 = 0.012;
/// Samples a pixel after which a picture counts as sharp.
pub const ENOUGH: u32 = 512;
/// Samples that count of those taken with an earlier estimate.
const MEMORY: f64 = 3.0;

/// Radiance of a view, accumulated pass by pass.
#[derive(Debug)]
pub struct Progressive {
    width: usize,
    sums: Vec<DVec3>,
    /// Samples that `sums` stand for, in whole passes.
    weight: f64,
    pass: u32,
    row: usize,
    rows_a_second: f64,
}

impl Progressive {
    /// Nothing yet.
    pub fn new(camera: &Camera) -> Self {
        let k = &camera.intrinsics;
        Self {
            width: (k.width as usize).max(1),
            sums: vec![DVec3::ZERO; k.width as usize * k.height as usize],
            weight: 0.0,
            pass: 0,
            row: 0,
            rows_a_second: 0.0,
        }
    }

    /// Lets earlier samples count for a few at most, because the light has changed a little.
    pub fn fade(&mut self) {
        if self.weight > MEMORY {
            let factor = MEMORY / self.weight;
            let width = self.width;
            for (row, sums) in self.sums.chunks_mut(width).enumerate() {
                // Rows of the pass under way hold one sample more than the rest.
                let factor = match row < self.row {
                    true => (MEMORY + 1.0) / (self.weight + 1.0),
                    false => factor,
                };
                sums.iter_mut().for_each(|sum| *sum *= factor);
            }
            self.weight = MEMORY;
        }
    }

    /// Forgets all samples.
    pub fn clear(&mut self) {
        self.sums.fill(DVec3::ZERO);
        self.weight = 0.0;
        self.row = 0;
    }

    /// Samples a pixel.
    pub fn samples(&self) -> u32 {
        self.weight as u32
    }

    /// Draws some rows; true when a pass over the picture is complete.
    pub fn add(&mut self, world: &Lit, camera: &Camera, options: &PathOptions) -> bool {
        let started = Instant::now();
        let width = self.width;
        let height = self.sums.len() / width;
        let wanted = ((self.rows_a_second * SLICE) as usize).max(rayon::current_num_threads());
        let last = (self.row + wanted).min(height);
        let (row, pass) = (self.row, u64::from(self.pass));
        self.sums[row * width..last * width]
            .par_chunks_mut(width)
            .enumerate()
            .for_each(|(i, sums)| {
                for (x, sum) in sums.iter_mut().enumerate() {
                    let y = row + i;
                    let mut stream = Stream::new(0, 0, (y * width + x) as u64, pass);
                    let [dx, dy] = stream.uniform2();
                    let ray = camera.ray(Vec2::new(x as f32 + dx, y as f32 + dy));
                    *sum += radiance(world, &ray, &mut stream, options)
                        .radiance
                        .as_dvec3();
                }
            });
        let seconds = started.elapsed().as_secs_f64().max(1e-6);
        self.rows_a_second = (last - row) as f64 / seconds;
        self.row = last;
        if last < height {
            return false;
        }
        self.row = 0;
        self.pass += 1;
        self.weight += 1.0;
        true
    }

    /// Mean radiance; only between passes.
    pub fn picture(&self, camera: &Camera) -> Picture {
        let scale = if self.weight > 0.0 {
            self.weight.recip()
        } else {
            0.0
        };
        Picture {
            width: camera.intrinsics.width,
            height: camera.intrinsics.height,
            pixels: self.sums.iter().map(|s| (*s * scale).as_vec3()).collect(),
        }
    }
}
