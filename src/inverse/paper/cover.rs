//! The pixels that each patch covers and their errors, which select the patches to cut.

use crate::calibrate::held_out::HoldOut;
use crate::calibrate::problem::Problem;
use crate::inverse::paper::descent::Descent;
use crate::inverse::paper::patches::{MAX_DEPTH, Patches};
use crate::inverse::paper::pixel::{Drawn, Path};
use crate::inverse::settings::Settings;
use crate::math::rng::Stream;
use crate::math::stats::Moments;
use crate::scene::geometry::Hit;
use crate::transport::arrival::RayCount;
use glam::Vec3;
use rayon::prelude::*;

/// Greatest number of pixels; above it every n-th pixel is used.
const MAX_PIXELS: usize = 400_000;
/// Least number of pixels of a patch that is cut: four for each of its parts.
const MIN_COVERED: u64 = 16;
/// Fraction of the squared error of all patches that may be cut, which is in the cut patches.
const CUT: f64 = 0.9;
/// Standard errors of a patch's mean squared error above zero from which it may be cut.
const SIGNIFICANT: f64 = 2.0;
/// Paths for each of two independent colours of a pixel.
const SAMPLES: u64 = 8;
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
        let mut errors = vec![Moments::default(); patches.len()];
        for ((_, _, hit), (error, _)) in self.pixels.iter().zip(each) {
            errors[patches.of_texel(patches.layout.texel(hit))].push(error);
        }
        (worst(&errors, self.stride, &patches.depth), cast)
    }
}

/// The patches of greatest mean squared error that together hold the fraction [`CUT`] of the error of all that may be cut. `errors`
/// has the errors of each patch's pixels, each of which stands for `stride` pixels.
fn worst(errors: &[Moments], stride: u64, depth: &[u8]) -> Vec<bool> {
    let may_be_cut = |&p: &usize| {
        let error = &errors[p];
        let is_significant = error.mean > SIGNIFICANT * error.standard_error();
        is_significant && error.count * stride >= MIN_COVERED && depth[p] < MAX_DEPTH
    };
    let mut order: Vec<usize> = (0..errors.len()).filter(may_be_cut).collect();
    order.sort_by(|&p, &q| errors[q].mean.total_cmp(&errors[p].mean));
    let sum = |p: usize| errors[p].mean * errors[p].count as f64;
    let all: f64 = order.iter().map(|&p| sum(p)).sum();
    let mut which = vec![false; errors.len()];
    let mut held = 0.0;
    for p in order {
        if held >= CUT * all {
            break;
        }
        held += sum(p);
        which[p] = true;
    }
    which
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_are_cut_and_what_is_small_or_fine_or_within_noise_is_not() {
        let patch = |mean: f64, spread: f64, pixels: u64| -> Moments {
            let sign = |pixel| if pixel % 2 == 0 { 1.0 } else { -1.0 };
            (0..pixels)
                .map(|pixel| mean + spread * sign(pixel))
                .collect()
        };
        let errors = [
            patch(1.0, 0.1, 100),
            patch(9.0, 0.1, 100),
            patch(5.0, 0.1, 15),
            patch(0.5, 0.1, 100),
            patch(9.0, 90.0, 100),
            Moments::default(),
        ];
        let depth = [0; 6];
        let which = worst(&errors, 1, &depth);
        assert_eq!(which, [true, true, false, false, false, false]);
        let which = worst(&errors, 1, &[0, MAX_DEPTH, 0, 0, 0, 0]);
        assert_eq!(which, [true, false, false, true, false, false]);
        assert_eq!(worst(&errors[5..], 1, &depth[5..]), [false]);
        // One pixel of four is looked at.
        assert!(worst(&errors, 4, &depth)[2]);
    }
}
