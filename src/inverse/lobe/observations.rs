//! Spots of a surface, and their observations by each photograph.
//!
//! A diffuse spot has the same radiance in all views, so that differences between photographs of one spot indicate gloss.

use crate::calibrate::gbuffer::GBuffer;
use crate::calibrate::measured_radiance::cell_key;
use crate::calibrate::problem::Problem;
use glam::DVec3;
use rayon::prelude::*;

/// Width of a spot in pixel footprints.
const SPOT_FOOTPRINTS: f32 = 3.0;

/// The pixels of one photograph that see one spot.
#[derive(Debug, Clone, PartialEq)]
pub struct SpotObservation {
    pub frame: u32,
    /// Pixel indices, row by row from the top left.
    pub pixels: Vec<u32>,
    /// Their mean radiance.
    pub measured: DVec3,
    /// Whether they are held out of every fit.
    pub held_out: bool,
}

/// A spot's observations; those in the fit come first.
pub type Spot = Vec<SpotObservation>;

/// Number of photographs in the fit that see a spot.
pub fn views(spot: &[SpotObservation]) -> usize {
    spot.iter().filter(|s| !s.held_out).count()
}

/// The spots of each object, in the order of their hash keys, which is random in space.
pub fn spots(problem: &Problem, gbuffer: &GBuffer) -> Vec<Vec<Spot>> {
    let mut of_object = vec![Vec::new(); problem.scene.objects.len()];
    let size = gbuffer.footprint * SPOT_FOOTPRINTS;
    if size <= 0.0 {
        return of_object;
    }
    let value = |frame: u32, pixel: u32| problem.photographs[frame as usize].pixels[pixel as usize];
    let mut seen: Vec<(u32, u64, bool, u32, u32)> = (gbuffer.pixels.par_iter())
        .filter(|p| p.pure && !problem.photographs[p.frame as usize].is_saturated(p.pixel as usize))
        .filter_map(|p| {
            let point = p.points.iter().flatten().next()?;
            let key = cell_key(size, point);
            Some((p.object, key, p.held_out, p.frame, p.pixel))
        })
        .collect();
    seen.par_sort_unstable();
    for spot in seen.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let observations = spot.chunk_by(|a, b| (a.2, a.3) == (b.2, b.3)).map(|own| {
            let pixels: Vec<u32> = own.iter().map(|s| s.4).collect();
            let frame = own[0].3;
            let sum: DVec3 = (pixels.iter()).map(|&p| value(frame, p).as_dvec3()).sum();
            SpotObservation {
                frame,
                measured: sum / pixels.len() as f64,
                pixels,
                held_out: own[0].2,
            }
        });
        if let Some(spots) = of_object.get_mut(spot[0].0 as usize) {
            spots.push(observations.collect());
        }
    }
    of_object
}

/// Spots with about `max` observations in the fit in total, those that several photographs see first; none with fewer than
/// `min_views` views.
pub fn choose(spots: &[Spot], min_views: usize, max: usize) -> Vec<&Spot> {
    let several = spots.iter().filter(|s| views(s) >= 2.max(min_views));
    let single = (spots.iter()).filter(|s| views(s) == 1 && min_views <= 1);
    let mut count = 0;
    several
        .chain(single)
        .take_while(|spot| {
            let has_room = count < max;
            count += views(spot);
            has_room
        })
        .collect()
}
