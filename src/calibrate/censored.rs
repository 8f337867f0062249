//! Marks pixels of overexposed lamps in scans as censored: their values become lower bounds.
//!
//! Where most pixels of an object are saturated, its darker pixels are mixtures of the object with its surroundings: through
//! the pixel filter, the lens, or an inexact outline of the mesh. A fit to their values would hold the lamp's emission at the
//! saturation level and compensate with too high an albedo of the surfaces.

use crate::calibrate::gbuffer::{GBuffer, GBufferPixel};
use crate::calibrate::problem::Problem;
use crate::capture::photograph::Photograph;
use glam::{BVec3, Vec3};
use std::sync::Arc;

/// The problem with such pixels turned into lower bounds (`Photograph::limits`), per channel; `None` if there are none.
///
/// Pixels at the edges of such an object become lower bounds in every photograph, also where it is not saturated.
pub fn bounded(problem: &Problem, gbuffer: &GBuffer) -> Option<Problem> {
    let (frames, objects) = (problem.photographs.len(), gbuffer.seen.len());
    let counts = Counts::new(problem, gbuffer);
    let overexposed = |frame: usize, object: usize| counts.mostly_saturated(frame, object);
    let overexposed_anywhere: Vec<BVec3> = (0..objects)
        .map(|object| (0..frames).fold(BVec3::FALSE, |any, frame| any | overexposed(frame, object)))
        .collect();
    if !overexposed_anywhere.iter().any(|channels| channels.any()) {
        return None;
    }
    let mut limits: Vec<Vec<Vec3>> = vec![Vec::new(); frames];
    for pixel in &gbuffer.pixels {
        let anywhere = overexposed_anywhere.get(pixel.object as usize);
        let Some(&anywhere) = anywhere.filter(|channels| channels.any()) else {
            continue;
        };
        let (frame, index) = (pixel.frame as usize, pixel.pixel as usize);
        let censored = match pixel.inside {
            true => overexposed(frame, pixel.object as usize),
            false => anywhere,
        };
        let photograph = &problem.photographs[frame];
        let limits = &mut limits[frame];
        if limits.is_empty() {
            limits.extend((0..photograph.pixels.len()).map(|i| photograph.limit(i)));
        }
        let value = photograph.pixels[index].min(limits[index]);
        limits[index] = Vec3::select(censored, value, limits[index]);
    }
    let photographs = problem.photographs.iter().zip(limits);
    Some(Problem {
        scene: problem.scene.clone(),
        photographs: photographs
            .map(|(photograph, limits)| match limits.is_empty() {
                true => photograph.clone(),
                false => Arc::new(Photograph {
                    limits,
                    ..(**photograph).clone()
                }),
            })
            .collect(),
    })
}

struct Counts {
    objects: usize,
    /// For pure pixels and for all pixels: their number, and how many are saturated in R, G and B.
    counts: Vec<[[u32; 4]; 2]>,
}

impl Counts {
    fn new(problem: &Problem, gbuffer: &GBuffer) -> Self {
        let objects = gbuffer.seen.len();
        let mut counts = vec![[[0; 4]; 2]; problem.photographs.len() * objects];
        let fitted = |pixel: &&GBufferPixel| !pixel.held_out && (pixel.object as usize) < objects;
        for pixel in gbuffer.pixels.iter().filter(fitted) {
            let photograph = &problem.photographs[pixel.frame as usize];
            let saturated = photograph.saturated(pixel.pixel as usize);
            let entry = &mut counts[pixel.frame as usize * objects + pixel.object as usize];
            for kind in [pixel.pure.then_some(0), Some(1)].into_iter().flatten() {
                entry[kind][0] += 1;
                for channel in 0..3 {
                    entry[kind][1 + channel] += u32::from(saturated.test(channel));
                }
            }
        }
        Self { objects, counts }
    }

    /// Channels in which most of an object's pixels in a photograph are saturated: its pure pixels, or all if none is pure.
    fn mostly_saturated(&self, frame: usize, object: usize) -> BVec3 {
        let [pure, all] = self.counts[frame * self.objects + object];
        let [pixels, r, g, b] = if pure[0] > 0 { pure } else { all };
        BVec3::from([r, g, b].map(|saturated| 2 * saturated > pixels))
    }
}
