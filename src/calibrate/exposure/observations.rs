//! Observations of surface cells by photographs, from which exposures are estimated.

use crate::calibrate::gbuffer::{GBuffer, GBufferPixel};
use crate::calibrate::measured_radiance::cell_key;
use crate::calibrate::problem::Problem;
use crate::capture::exposure::Vignetting;
use crate::math::stats::quantile;
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;

/// Width of a surface cell in pixel footprints.
const CELL_FOOTPRINTS: f32 = 4.0;
/// Pixels darker than this fraction of the photographs' median level hold mostly noise.
const ABOVE_NOISE: f64 = 0.1;

/// The log mean value of one surface cell in one photograph.
#[derive(Debug, Clone, Copy)]
pub(super) struct Observation {
    pub frame: usize,
    pub cell: u64,
    /// Logarithm of the mean value.
    pub level: DVec3,
    /// Mean [`Vignetting::off_axis`] of the pixels.
    pub off_axis: f64,
    /// Logarithm of the photograph's saturation value.
    pub saturation: DVec3,
}

/// The observations of all cells, sorted by cell.
#[derive(Debug, Default)]
pub struct Observations {
    pub(super) fitted: Vec<Observation>,
    /// Observations by photographs that are held out whole. They are compared with the fitted ones and never fitted.
    pub(super) held_out: Vec<Observation>,
}

/// Sums over the pixels of a photograph that see a cell.
#[derive(Default)]
struct Sums {
    value: DVec3,
    off_axis: f64,
    count: f64,
}

impl Observations {
    /// Collects pure pixels that are neither saturated nor dark. Held-out pixels count only in photographs held out whole.
    pub fn new(problem: &Problem, gbuffer: &GBuffer) -> Self {
        let size = gbuffer.footprint * CELL_FOOTPRINTS;
        if size <= 0.0 {
            return Self::default();
        }
        let held_out = gbuffer.unfitted(problem.photographs.len());
        let value = |p: &GBufferPixel| {
            problem.photographs[p.frame as usize].pixels[p.pixel as usize].as_dvec3()
        };
        let usable = |p: &&GBufferPixel| {
            let photograph = &problem.photographs[p.frame as usize];
            p.pure
                && p.held_out == held_out[p.frame as usize]
                && !photograph.is_saturated(p.pixel as usize)
        };
        let mut levels: Vec<f64> = (gbuffer.pixels.iter().filter(usable))
            .filter(|p| !p.held_out)
            .map(|p| value(p).max_element())
            .collect();
        let dark = (quantile(&mut levels, 0.5).unwrap_or(0.0) * ABOVE_NOISE).max(f64::MIN_POSITIVE);

        let mut sums: BTreeMap<(u64, u32), Sums> = BTreeMap::new();
        for pixel in gbuffer.pixels.iter().filter(usable) {
            let value = value(pixel);
            if value.min_element() < dark {
                continue;
            }
            if let Some(point) = pixel.points.iter().flatten().next() {
                let key = (cell_key(size, point), pixel.frame);
                let sum = sums.entry(key).or_default();
                let frame = pixel.frame as usize;
                let columns = problem.photographs[frame].width.max(1);
                let [x, y] = [pixel.pixel % columns, pixel.pixel / columns].map(f64::from);
                let lens = &problem.scene.cameras[frame].intrinsics;
                sum.value += value;
                sum.off_axis += Vignetting::off_axis(lens, DVec2::new(x, y) + 0.5);
                sum.count += 1.0;
            }
        }
        let observation = |((cell, frame), sum): ((u64, u32), Sums)| Observation {
            frame: frame as usize,
            cell,
            level: (sum.value / sum.count).map(f64::ln),
            off_axis: sum.off_axis / sum.count,
            saturation: (problem.photographs[frame as usize].saturation.as_dvec3()).map(f64::ln),
        };
        let (held_out, fitted) =
            (sums.into_iter().map(observation)).partition(|s| held_out[s.frame]);
        Self { fitted, held_out }
    }

    pub(super) fn remove(&mut self, frame: usize) {
        self.fitted.retain(|observation| observation.frame != frame);
        self.held_out
            .retain(|observation| observation.frame != frame);
    }
}

#[cfg(test)]
impl Observation {
    /// A grey observation on the optical axis, for tests.
    pub fn grey(frame: usize, cell: usize, level: f64) -> Self {
        Self {
            frame,
            cell: cell as u64,
            level: DVec3::splat(level),
            off_axis: 0.0,
            saturation: DVec3::ZERO,
        }
    }
}

/// The observations of cells that at least two photographs see.
pub(super) fn shared(observations: &[Observation]) -> Vec<Observation> {
    let cells = observations.chunk_by(|a, b| a.cell == b.cell);
    (cells.filter(|cell| cell.len() > 1).flatten().copied()).collect()
}
