//! The reported loss: mean absolute difference of re-renders on fixed sets of pixels. Saturated values are lower bounds.

use crate::calibrate::held_out::HoldOut;
use crate::calibrate::problem::Problem;
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::math::rng::{Stream, splitmix64};
use crate::math::stats::Moments;
use crate::scene::visibility::NOTHING;
use crate::transport::arrival::RayCount;
use crate::transport::lit::LitScene;
use crate::transport::path::{PathOptions, radiance};
use glam::{DVec3, Vec2};
use rayon::prelude::*;

/// First of the sample keys of loss paths, disjoint from those of the fit.
const KEY: u64 = 1 << 61;

/// Two fixed sets of pixels: in the fit, and held out.
#[derive(Debug, Clone)]
pub struct LossProbe {
    train: Vec<(u32, u32)>,
    held_out: Vec<(u32, u32)>,
    samples: u64,
    max_bounces: u32,
    seed: u64,
}

/// Losses of one estimate.
#[derive(Debug, Clone, Copy)]
pub struct Losses {
    /// On pixels in the fit; `None` if there are none.
    pub train: Option<f64>,
    /// On held-out pixels; `None` if there are none.
    pub held_out: Option<f64>,
    /// Rays cast and paths rejected; rejected samples count as black.
    pub cast: RayCount,
}

/// The part of the photographed light that comes after a number of bounces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LateLight {
    /// Its fraction of all light, in the channel with the largest fraction.
    pub fraction: f64,
    /// Standard error of the fraction over pixels.
    pub stderr: f64,
    /// Rays cast and paths rejected.
    pub cast: RayCount,
}

impl LossProbe {
    /// Chooses up to `pixels` usable pixels that see the mesh for each set, spread evenly over all photographs. Each is rendered
    /// with `samples` paths of at most `max_bounces` bounces.
    pub fn new(
        problem: &Problem,
        settings: &Settings,
        pixels: usize,
        samples: u64,
        max_bounces: u32,
    ) -> Self {
        let mut sets = [Vec::new(), Vec::new()];
        // About forty times as many pixels are visited, which is enough to find the held-out ones.
        let stride = (problem.pixels() / (pixels * 40).max(1)).max(1);
        let triangles = &problem.scene.ids().triangles;
        let mut next = 0;
        while let Some((frame, pixel)) = problem.locate(next) {
            let usable = problem.photographs[frame].is_usable(pixel);
            if usable && triangles[frame].get(pixel) != Some(&NOTHING) {
                let held = HoldOut::from(settings).contains(frame as u32, pixel as u32);
                sets[usize::from(held)].push((frame as u32, pixel as u32));
            }
            next += 1 + splitmix64(next as u64) as usize % (2 * stride - 1).max(1);
        }
        let [train, held_out] = sets.map(|all| {
            let count = all.len().min(pixels);
            (0..count)
                .map(|i| all[i * all.len() / count.max(1)])
                .collect()
        });
        Self {
            train,
            held_out,
            samples,
            max_bounces,
            seed: settings.seed,
        }
    }

    /// Number of paths of a measurement.
    pub fn paths(&self) -> u64 {
        (self.train.len() + self.held_out.len()) as u64 * self.samples
    }

    /// The same pixels and paths, with at most `max_bounces` bounces.
    #[must_use]
    pub fn deepened(&self, max_bounces: u32) -> Self {
        Self {
            max_bounces,
            ..self.clone()
        }
    }

    /// Renders both sets with an estimate.
    pub fn measure(&self, problem: &Problem, estimate: &Estimate) -> Losses {
        let lit = estimate.lit(&problem.scene);
        let (train, mut cast) = self.differences(problem, &lit, &self.train);
        let (held_out, cast_held_out) = self.differences(problem, &lit, &self.held_out);
        cast += cast_held_out;
        Losses {
            train: mean(&train),
            held_out: mean(&held_out),
            cast,
        }
    }

    /// Mean absolute difference on the held-out pixels alone (`None` if there are none), and the rays cast.
    pub fn held_out(&self, problem: &Problem, estimate: &Estimate) -> (Option<f64>, RayCount) {
        let (each, cast) = self.held_out_each(problem, estimate);
        (mean(&each), cast)
    }

    /// Mean absolute difference over the channels of each held-out pixel, in the same order for any estimate, and the rays cast.
    pub fn held_out_each(&self, problem: &Problem, estimate: &Estimate) -> (Vec<f64>, RayCount) {
        let lit = estimate.lit(&problem.scene);
        self.differences(problem, &lit, &self.held_out)
    }

    /// The part of the photographed light that comes after `bounces` bounces, according to an estimate: the difference between the
    /// probe's paths and the same paths cut off there. `None` if no pixel is in the fit, or everything is black.
    pub fn beyond(
        &self,
        problem: &Problem,
        estimate: &Estimate,
        bounces: u32,
    ) -> Option<LateLight> {
        let lit = estimate.lit(&problem.scene);
        let each: Vec<([DVec3; 2], RayCount)> = (self.train.par_iter())
            .map(|&pixel| {
                let [whole, cut] = [self.max_bounces, bounces]
                    .map(|max_bounces| self.rendered(problem, &lit, pixel, max_bounces));
                let mut cast = whole.1;
                cast += cut.1;
                ([whole.0, whole.0 - cut.0], cast)
            })
            .collect();
        let cast = each.iter().map(|e| e.1).sum();
        let count = each.len() as f64;
        let mean = |i: usize| each.iter().map(|e| e.0[i]).sum::<DVec3>() / count;
        let [all, late] = [mean(0), mean(1)];
        let fractions = late / all;
        let channel = (0..3)
            .filter(|&c| fractions[c].is_finite())
            .max_by(|&a, &b| fractions[a].total_cmp(&fractions[b]))?;
        // Standard error of a ratio of means, to first order.
        let fraction = fractions[channel];
        let deviations: Moments = (each.iter())
            .map(|([all, late], _)| late[channel] - fraction * all[channel])
            .collect();
        Some(LateLight {
            fraction,
            stderr: deviations.standard_error() / all[channel],
            cast,
        })
    }

    fn differences(
        &self,
        problem: &Problem,
        lit: &LitScene,
        pixels: &[(u32, u32)],
    ) -> (Vec<f64>, RayCount) {
        let (each, casts): (Vec<f64>, Vec<RayCount>) = pixels
            .par_iter()
            .map(|&(frame, pixel)| {
                let (rendered, cast) =
                    self.rendered(problem, lit, (frame, pixel), self.max_bounces);
                let photograph = &problem.photographs[frame as usize];
                let measured = photograph.pixels[pixel as usize].as_dvec3();
                let residual = measured - rendered;
                let censored = photograph.saturated(pixel as usize);
                let error = DVec3::select(censored, residual.max(DVec3::ZERO), residual.abs());
                (error.element_sum() / 3.0, cast)
            })
            .unzip();
        (each, casts.into_iter().sum())
    }

    /// Radiance of a pixel (frame, index) by paths of at most `max_bounces` bounces.
    fn rendered(
        &self,
        problem: &Problem,
        lit: &LitScene,
        (frame, pixel): (u32, u32),
        max_bounces: u32,
    ) -> (DVec3, RayCount) {
        let options = PathOptions {
            max_bounces,
            ..Default::default()
        };
        let camera = &problem.scene.cameras[frame as usize];
        let corner = camera.corner(pixel as usize);
        let mut sum = DVec3::ZERO;
        let mut cast = RayCount::default();
        for sample in 0..self.samples {
            let mut stream =
                Stream::new(self.seed, u64::from(frame), u64::from(pixel), KEY + sample);
            let ray = camera.ray(corner + Vec2::from_array(stream.uniform2()));
            let path = radiance(lit, &ray, &mut stream, &options);
            sum += path.radiance.as_dvec3();
            cast.rays += u64::from(path.rays);
            cast.rejected += u64::from(path.rejected);
        }
        (sum / self.samples as f64, cast)
    }
}

fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}
