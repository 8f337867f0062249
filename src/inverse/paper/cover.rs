//! The pixels that each patch covers and their errors, which select the patches to cut.

use crate::calibrate::held_out::HoldOut;
use crate::calibrate::problem::Problem;
use crate::inverse::paper::descent::Descent;
use crate::inverse::paper::patches::{MAX_DEPTH, Patches};
use crate::inverse::paper::pixel::{Drawn, Path};
use crate::inverse::settings::Settings;
use crate::math::rng::Stream;
use crate::scene::geometry::Hit;
use crate::transport::arrival::RayCount;
use glam::Vec3;
use rayon::prelude::*;

/// Greatest number of pixels; above it every n-th pixel is used.
const MAX_PIXELS: usize = 400_000;
/// Least number of pixels of a patch that is cut: four for each of its parts.
const MIN_COVERED: u64 = 16;
/// Fraction of the pixels of all patches that may be cut, which the cut patches cover.
const CUT: f64 = 0.5;
/// Paths for each of two independent colours of a pixel.
const SAMPLES: u64 = 2;
/// First of the sample keys of these paths, disjoint from those of the descent.
const KEY: u64 = 1 << 63;

/// The pixels in the fit and the hits of their centres.
pub struct Cover {
    /// Frame, pixel and hit.
    pixels: Vec<(u32, u32, Hit)>,
    /// Number of pixels that each one stands for.
    stride: u64,
}

impl Cover {
    /// Casts a ray through the centre of each pixel.
    pub fn new(problem: &Problem, settings: &Settings) -> Self {
        let stride = problem.pixels().div_ceil(MAX_PIXELS).max(1);
        let hit = |index: usize| {
            let (frame, pixel) = problem.locate(index * stride)?;
            let photograph = &problem.photographs[frame];
            let held_out = HoldOut::from(settings).contains(frame as u32, pixel as u32);
            if held_out || !photograph.is_usable(pixel) {
                return None;
            }
            let camera = &problem.scene.cameras[frame];
            let center = camera.corner(pixel) + 0.5;
            let hit = problem.scene.intersect(&camera.ray(center))?;
            Some((frame as u32, pixel as u32, hit))
        };
        let visited = 0..problem.pixels().div_ceil(stride);
        Self {
            pixels: visited.into_par_iter().filter_map(hit).collect(),
            stride: stride as u64,
        }
    }

    /// The number of pixels that each patch covers.
    pub fn counts(&self, patches: &Patches) -> Vec<u64> {
        let mut counts = vec![0; patches.len()];
        for (_, _, hit) in &self.pixels {
            counts[patches.of_texel(patches.layout.texel(hit))] += self.stride;
        }
        counts
    }

    /// Selects the patches to cut by the mean squared error of the pixels that they cover. Also returns the rays cast.
    ///
    /// The squared error of a pixel is the product of the residuals of two independent colours, which is free of path noise.
    pub fn to_cut(
        &self,
        problem: &Problem,
        settings: &Settings,
        bounces: u32,
        descent: &mut Descent,
    ) -> (Vec<bool>, RayCount) {
        let each: Vec<(f64, RayCount)> = descent.render(problem, settings, bounces, |rendering| {
            let error = |&(frame, pixel, _): &(u32, u32, Hit)| {
                let (frame_key, pixel_key) = (u64::from(frame), u64::from(pixel));
                let mut stream = Stream::new(settings.seed, frame_key, pixel_key, KEY);
                let (mut path, mut cast) = (Path::default(), RayCount::default());
                let drawn = Drawn {
                    frame,
                    pixel,
                    weight: 1.0,
                };
                let photograph = &problem.photographs[frame as usize];
                let censored = photograph.saturated(pixel as usize);
                let mut residual = || {
                    let colour =
                        rendering.colour(drawn, SAMPLES, &mut stream, &mut path, &mut cast);
                    let residual = colour - photograph.pixels[pixel as usize];
                    Vec3::select(censored, residual.min(Vec3::ZERO), residual)
                };
                let [a, b] = [residual(), residual()];
                (f64::from(a.dot(b)), cast)
            };
            self.pixels.par_iter().map(error).collect()
        });
        let cast = each.iter().map(|e| e.1).sum();
        let Some(patches) = &descent.patches else {
            return (Vec::new(), cast);
        };
        let mut sums = vec![(0.0, 0u64); patches.len()];
        for ((_, _, hit), (error, _)) in self.pixels.iter().zip(each) {
            let sum = &mut sums[patches.of_texel(patches.layout.texel(hit))];
            sum.0 += error;
            sum.1 += self.stride;
        }
        (worst(&sums, &patches.depth), cast)
    }
}

/// The patches of greatest mean error that together cover the fraction [`CUT`] of the pixels of all that may be cut. `sums` holds
/// the sum of errors and the number of pixels of each patch.
fn worst(sums: &[(f64, u64)], depth: &[u8]) -> Vec<bool> {
    let may_be_cut = |&p: &usize| sums[p].1 >= MIN_COVERED && depth[p] < MAX_DEPTH;
    let mut order: Vec<usize> = (0..sums.len()).filter(may_be_cut).collect();
    let mean = |p: usize| sums[p].0 / sums[p].1 as f64;
    order.sort_by(|&p, &q| mean(q).total_cmp(&mean(p)));
    let all: u64 = order.iter().map(|&p| sums[p].1).sum();
    let mut which = vec![false; sums.len()];
    let mut covered = 0;
    for p in order {
        if covered as f64 >= CUT * all as f64 {
            break;
        }
        covered += sums[p].1;
        which[p] = true;
    }
    which
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_are_cut_and_what_is_small_or_fine_is_not() {
        let sums = [
            (100.0, 100),
            (900.0, 100),
            (500.0, 15),
            (50.0, 100),
            (0.0, 0),
        ];
        let depth = [0, 0, 0, 0, 0];
        let which = worst(&sums, &depth);
        assert_eq!(which, [true, true, false, false, false]);
        let which = worst(&sums, &[0, MAX_DEPTH, 0, 0, 0]);
        assert_eq!(which, [true, false, false, false, false]);
        assert_eq!(worst(&sums[4..], &depth[4..]), [false]);
    }
}
