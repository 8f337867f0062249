//! A progressive render, in slices of rows.

use crate::error::Result;
use crate::gpu::{Tracer, View};
use crate::math::picture::Picture;
use crate::math::rng::Stream;
use crate::scene::camera::Camera;
use crate::transport::layers::{Parts, Split, layer_of};
use crate::transport::lit::LitScene;
use crate::transport::path::{PathOptions, radiance};
use glam::{DVec3, Vec2, Vec3};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

/// Duration of a slice in seconds.
const SLICE: f64 = 0.012;
/// Samples per pixel at which a picture is finished.
pub const MAX_SAMPLES: u32 = 512;
/// Most samples that earlier estimates count as.
const MAX_EARLIER_SAMPLES: f64 = 3.0;

/// Radiance of a view, accumulated pass by pass; in layers by lamp with a split.
#[derive(Debug)]
pub struct Progressive {
    width: usize,
    height: usize,
    pub split: Option<Arc<Split>>,
    /// Sums by rows, all layers of a pixel together; without a split, of even passes.
    sums: Vec<DVec3>,
    /// Sums of odd passes, without a split: an independent half for estimating the noise.
    half: Vec<DVec3>,
    /// Number of samples in `half`.
    half_weight: f64,
    /// Whether to reduce the weight of earlier samples at the end of the pass.
    fades: bool,
    /// Number of samples in `sums` and `half` together, in whole passes.
    weight: f64,
    pass: u32,
    row: usize,
    rows_a_second: f64,
}

impl Progressive {
    pub fn new(camera: &Camera, split: Option<Arc<Split>>) -> Self {
        let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
        let layers = split.as_ref().map_or(1, |split| split.sources().len());
        let pixels = width as usize * height as usize;
        let halved = if split.is_none() { pixels } else { 0 };
        Self {
            half: vec![DVec3::ZERO; halved],
            half_weight: 0.0,
            fades: false,
            width: width as usize,
            height: height as usize,
            split,
            sums: vec![DVec3::ZERO; pixels * layers],
            weight: 0.0,
            pass: 0,
            row: 0,
            rows_a_second: 0.0,
        }
    }

    fn layers(&self) -> usize {
        self.split.as_ref().map_or(1, |split| split.sources().len())
    }

    /// Reduces the weight of earlier samples after a small change of the light, at the end of the current pass.
    pub fn fade(&mut self) {
        self.fades = self.row > 0;
        if self.row == 0 && self.weight > MAX_EARLIER_SAMPLES {
            let factor = MAX_EARLIER_SAMPLES / self.weight;
            let sums = self.sums.iter_mut().chain(&mut self.half);
            sums.for_each(|sum| *sum *= factor);
            self.half_weight *= factor;
            self.weight = MAX_EARLIER_SAMPLES;
        }
    }

    pub fn clear(&mut self) {
        self.sums.fill(DVec3::ZERO);
        self.half.fill(DVec3::ZERO);
        (self.weight, self.half_weight) = (0.0, 0.0);
        self.row = 0;
    }

    pub fn samples(&self) -> u32 {
        self.weight as u32
    }

    /// Renders some rows. Returns whether a pass is complete.
    pub fn add(&mut self, world: &LitScene, camera: &Camera, options: &PathOptions) -> bool {
        let started = Instant::now();
        let (width, height, layers) = (self.width, self.height, self.layers());
        let row_of = width * layers;
        let split = self.split.clone();
        let wanted = ((self.rows_a_second * SLICE) as usize).max(rayon::current_num_threads());
        let last = (self.row + wanted).min(height);
        let (row, pass) = (self.row, u64::from(self.pass));
        self.sums_of_pass()[row * row_of..last * row_of]
            .par_chunks_mut(row_of.max(1))
            .enumerate()
            .for_each(|(i, sums)| {
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
        self.end_pass();
        true
    }

    /// Renders a pass without a split on the graphics card; call it only between passes.
    ///
    /// # Errors
    /// The card failed. The render is unchanged if its pixels fit one buffer of the card, as 8 million do.
    pub fn add_on(
        &mut self,
        tracer: &mut Tracer,
        camera: &Camera,
        options: &PathOptions,
    ) -> Result<()> {
        let view = View {
            camera,
            options,
            seed: 0,
            frame: 0,
        };
        let pass = self.pass;
        tracer.accumulate(&view, pass..pass + 1, self.sums_of_pass())?;
        self.end_pass();
        Ok(())
    }

    /// Whether the next row is the first of a pass.
    pub fn is_between_passes(&self) -> bool {
        self.row == 0
    }

    fn sums_of_pass(&mut self) -> &mut [DVec3] {
        match self.is_odd_pass() {
            true => &mut self.half,
            false => &mut self.sums,
        }
    }

    /// Whether the samples of this pass belong to `half`.
    fn is_odd_pass(&self) -> bool {
        self.split.is_none() && self.pass % 2 == 1
    }

    fn end_pass(&mut self) {
        if self.is_odd_pass() {
            self.half_weight += 1.0;
        }
        self.row = 0;
        self.pass += 1;
        self.weight += 1.0;
        if std::mem::take(&mut self.fades) {
            self.fade();
        }
    }

    /// Mean radiance of all layers together; call it only between passes.
    pub fn picture(&self, camera: &Camera) -> Picture {
        let scale = self.scale();
        let pixels = match self.layers() {
            0 => vec![Vec3::ZERO; self.width * self.height],
            _ if self.split.is_none() => (self.sums.par_iter().zip(&self.half))
                .map(|(a, b)| ((*a + *b) * scale).as_vec3())
                .collect(),
            layers => (self.sums.chunks(layers))
                .map(|sums| (sums.iter().sum::<DVec3>() * scale).as_vec3())
                .collect(),
        };
        sized(camera, pixels)
    }

    /// Means of two independent halves; `None` until there are both.
    pub fn halves(&self, camera: &Camera) -> Option<[Picture; 2]> {
        let rest = self.weight - self.half_weight;
        if self.half.is_empty() || self.half_weight <= 0.0 || rest <= 0.0 {
            return None;
        }
        let mean = |sums: &[DVec3], weight: f64| {
            let pixels = sums.par_iter().map(|sum| (*sum / weight).as_vec3());
            sized(camera, pixels.collect())
        };
        Some([mean(&self.half, self.half_weight), mean(&self.sums, rest)])
    }

    /// Mean radiance of each layer; call it only between passes.
    pub fn layer_pictures(&self, camera: &Camera) -> Vec<Picture> {
        let (count, scale) = (self.layers(), self.scale());
        let picture = |layer| sized(camera, layer_of(&self.sums, layer, count, scale));
        (0..count).map(picture).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::{Adapters, Card};
    use crate::room::Room;

    /// Both halves and their sum, up to rounding, which can send a path elsewhere.
    #[test]
    fn passes_on_a_card_are_those_of_the_processor() {
        let Some(card) = Card::open(Adapters::Any) else {
            println!("skipped: no graphics adapter");
            return;
        };
        let lit = Room::new().lit([32, 24]).expect("the room is sound");
        let (camera, options) = (&lit.scene.cameras[1], PathOptions::default());
        let mut tracer = Tracer::new(&card, &lit, &[]).expect("the room fits");
        let mut renders = [(); 2].map(|()| Progressive::new(camera, None));
        for _ in 0..3 {
            while !renders[0].add(&lit, camera, &options) {}
            renders[1]
                .add_on(&mut tracer, camera, &options)
                .expect("the card works");
        }
        let [a, b] = renders.each_ref().map(|render| {
            let [half, other] = render.halves(camera).expect("both halves");
            [render.picture(camera), half, other]
        });
        for (a, b) in a.iter().zip(&b) {
            let pairs = a.pixels.iter().zip(&b.pixels);
            let alike = pairs.filter(|(a, b)| (**a - **b).abs().max_element() < 1e-3);
            let alike = alike.count() as f64 / a.pixels.len() as f64;
            assert!(alike > 0.97, "{alike}");
        }
    }
}
