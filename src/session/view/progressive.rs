//! A render that sharpens a slice of rows at a time.

use crate::math::rng::Stream;
use crate::scene::camera::Camera;
use crate::session::snapshot::Picture;
use crate::transport::layers::{Parts, Split, layer_of};
use crate::transport::lit::Lit;
use crate::transport::path::{PathOptions, radiance};
use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

/// Seconds that a slice should take.
const SLICE: f64 = 0.012;
/// Samples a pixel after which a picture counts as sharp.
pub const ENOUGH: u32 = 512;
/// Samples that count of those taken with an earlier estimate.
const MEMORY: f64 = 3.0;

/// Radiance of a view, accumulated pass by pass; in layers by lamp where a split is given.
#[derive(Debug)]
pub struct Progressive {
    width: usize,
    height: usize,
    split: Option<Arc<Split>>,
    /// Row by row, all layers of a pixel together.
    sums: Vec<DVec3>,
    /// The sums of every other pass alone, where no split is given: with the rest they tell the noise.
    half: Vec<DVec3>,
    /// Samples that `half` stands for.
    half_weight: f64,
    /// Whether earlier samples are to count for less once the pass is complete.
    fades: bool,
    /// Samples that `sums` stand for, in whole passes.
    weight: f64,
    pass: u32,
    row: usize,
    rows_a_second: f64,
}

impl Progressive {
    /// Nothing yet.
    pub fn new(camera: &Camera, split: Option<Arc<Split>>) -> Self {
        let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
        let layers = split.as_ref().map_or(1, |split| split.sources().len());
        let halved = if split.is_none() {
            width as usize * height as usize
        } else {
            0
        };
        Self {
            half: vec![DVec3::ZERO; halved],
            half_weight: 0.0,
            fades: false,
            width: width as usize,
            height: height as usize,
            split,
            sums: vec![DVec3::ZERO; width as usize * height as usize * layers],
            weight: 0.0,
            pass: 0,
            row: 0,
            rows_a_second: 0.0,
        }
    }

    /// How its layers are split by lamp, if they are.
    pub fn split(&self) -> Option<&Arc<Split>> {
        self.split.as_ref()
    }

    /// Layers a pixel.
    fn layers(&self) -> usize {
        self.split.as_ref().map_or(1, |split| split.sources().len())
    }

    /// Lets earlier samples count for a few at most, because the light has changed a little; from the end of the pass under way.
    pub fn fade(&mut self) {
        self.fades = self.row > 0;
        if self.row == 0 && self.weight > MEMORY {
            let factor = MEMORY / self.weight;
            let sums = self.sums.iter_mut().chain(&mut self.half);
            sums.for_each(|sum| *sum *= factor);
            self.half_weight *= factor;
            self.weight = MEMORY;
        }
    }

    /// Forgets all samples.
    pub fn clear(&mut self) {
        self.sums.fill(DVec3::ZERO);
        self.half.fill(DVec3::ZERO);
        (self.weight, self.half_weight) = (0.0, 0.0);
        self.row = 0;
    }

    /// Samples a pixel.
    pub fn samples(&self) -> u32 {
        self.weight as u32
    }

    /// Draws some rows; true when a pass over the picture is complete.
    pub fn add(&mut self, world: &Lit, camera: &Camera, options: &PathOptions) -> bool {
        let started = Instant::now();
        let (width, height, layers) = (self.width, self.height, self.layers());
        let row_of = width * layers;
        let split = self.split.clone();
        let wanted = ((self.rows_a_second * SLICE) as usize).max(rayon::current_num_threads());
        let last = (self.row + wanted).min(height);
        let (row, pass) = (self.row, u64::from(self.pass));
        let other = pass % 2 == 1 && split.is_none();
        let mut none = vec![Vec::new(); if other { 0 } else { last - row }];
        let halves: Vec<&mut [DVec3]> = match other {
            true => {
                let rows = &mut self.half[row * width..last * width];
                rows.chunks_mut(width.max(1)).collect()
            }
            false => none.iter_mut().map(Vec::as_mut_slice).collect(),
        };
        self.sums[row * row_of..last * row_of]
            .par_chunks_mut(row_of.max(1))
            .zip(halves)
            .enumerate()
            .for_each(|(i, (sums, half))| {
                let mut parts = Parts::new();
                for (x, sums) in sums.chunks_mut(layers).enumerate() {
                    let y = row + i;
                    let mut stream = Stream::new(0, 0, (y * width + x) as u64, pass);
                    let [dx, dy] = stream.uniform2();
                    let ray = camera.ray(Vec2::new(x as f32 + dx, y as f32 + dy));
                    match &split {
                        Some(split) => {
                            split.add(world, &ray, &mut stream, options, &mut parts, sums);
                        }
                        None => {
                            let sample = radiance(world, &ray, &mut stream, options);
                            sums[0] += sample.radiance.as_dvec3();
                            if let Some(half) = half.get_mut(x) {
                                *half += sample.radiance.as_dvec3();
                            }
                        }
                    }
                }
            });
        let seconds = started.elapsed().as_secs_f64().max(1e-6);
        self.rows_a_second = (last - row) as f64 / seconds;
        self.row = last;
        if last < height {
            return false;
        }
        self.row = 0;
        self.half_weight += if other { 1.0 } else { 0.0 };
        self.pass += 1;
        self.weight += 1.0;
        if std::mem::take(&mut self.fades) {
            self.fade();
        }
        true
    }

    /// Mean radiance, all layers together; only between passes.
    pub fn picture(&self, camera: &Camera) -> Picture {
        let scale = self.scale();
        let pixels = match self.layers() {
            0 => vec![Vec3::ZERO; self.width * self.height],
            layers => (self.sums.chunks(layers))
                .map(|sums| (sums.iter().sum::<DVec3>() * scale).as_vec3())
                .collect(),
        };
        sized(camera, pixels)
    }

    /// The means of two independent halves; `None` where there are none yet.
    pub fn halves(&self, camera: &Camera) -> Option<[Picture; 2]> {
        let rest = self.weight - self.half_weight;
        if self.half.is_empty() || self.half_weight <= 0.0 || rest <= 0.0 {
            return None;
        }
        let one = self
            .half
            .iter()
            .map(|sum| (*sum / self.half_weight).as_vec3());
        let other = self.sums.iter().zip(&self.half);
        let other = other.map(|(sum, half)| ((*sum - *half) / rest).as_vec3());
        Some([sized(camera, one.collect()), sized(camera, other.collect())])
    }

    /// Mean radiance of each layer; only between passes.
    pub fn layer_pictures(&self, camera: &Camera) -> Vec<Picture> {
        let (count, scale) = (self.layers(), self.scale());
        (0..count)
            .map(|layer| sized(camera, layer_of(&self.sums, layer, count, scale)))
            .collect()
    }

    fn scale(&self) -> f64 {
        match self.weight > 0.0 {
            true => self.weight.recip(),
            false => 0.0,
        }
    }
}

fn sized(camera: &Camera, pixels: Vec<Vec3>) -> Picture {
    Picture {
        width: camera.intrinsics.width,
        height: camera.intrinsics.height,
        pixels,
    }
}
