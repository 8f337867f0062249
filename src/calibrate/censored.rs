//! Lamps that photographs of a scan show saturated: their other pixels are mixtures.
//!
//! Where most of what a photograph shows of an object is saturated, the rest is darker because the pixel, the lens or the mesh's
//! outline mixes the object with what is beside it. Fitted as if it were measured, it would hold a lamp's light at the
//! level of saturation, and make up for the rest by surfaces that are too white.

use crate::calibrate::gbuffer::{GBuffer, GBufferPixel};
use crate::calibrate::problem::Problem;
use crate::capture::photograph::Photograph;
use glam::{BVec3, Vec3};
use std::sync::Arc;

/// The problem with lower bounds for such pixels, channel by channel; `None` where there are none.
///
/// Also bounds are the pixels at the edges of such an object in photographs that do not show it saturated.
pub fn bounded(problem: &Problem, gbuffer: &GBuffer) -> Option<Problem> {
    let (frames, objects) = (problem.photographs.len(), gbuffer.seen.len());
    let counts = Counts::new(problem, gbuffer);
    let overexposed = |frame: usize, object: usize| counts.mostly_saturated(frame, object);
    let ever: Vec<BVec3> = (0..objects)
        .map(|object| {
            (0..frames).fold(BVec3::FALSE, |ever, frame| {
                ever | overexposed(frame, object)
            })
        })
        .collect();
    if !ever.iter().any(|ever| ever.any()) {
        return None;
    }
    let mut limits: Vec<Vec<Vec3>> = vec![Vec::new(); frames];
    for pixel in &gbuffer.pixels {
        let Some(&ever) = ever.get(pixel.object as usize).filter(|ever| ever.any()) else {
            continue;
        };
        let (frame, index) = (pixel.frame as usize, pixel.pixel as usize);
        let bound = match pixel.inside {
            true => overexposed(frame, pixel.object as usize),
            false => ever,
        };
        let photograph = &problem.photographs[frame];
        let limits = &mut limits[frame];
        if limits.is_empty() {
            limits.extend((0..photograph.pixels.len()).map(|i| photograph.limit(i)));
        }
        let shown = photograph.pixels[index].min(limits[index]);
        limits[index] = Vec3::select(bound, shown, limits[index]);
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

/// Pixels by photograph and object: all of them, and those that each channel is saturated in.
struct Counts {
    objects: usize,
    /// Pixels away from edges, and all pixels where there are no such.
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
            let of = &mut counts[pixel.frame as usize * objects + pixel.object as usize];
            for kind in [pixel.pure.then_some(0), Some(1)].into_iter().flatten() {
                of[kind][0] += 1;
                for channel in 0..3 {
                    of[kind][1 + channel] += u32::from(saturated.test(channel));
                }
            }
        }
        Self { objects, counts }
    }

    /// In which channels most of an object's pixels in a photograph are saturated.
    fn mostly_saturated(&self, frame: usize, object: usize) -> BVec3 {
        let [pure, all] = self.counts[frame * self.objects + object];
        let [pixels, r, g, b] = if pure[0] > 0 { pure } else { all };
        BVec3::from([r, g, b].map(|saturated| 2 * saturated > pixels))
    }
}
