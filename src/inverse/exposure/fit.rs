//! Least absolute differences between what photographs show of the same cells.

use super::normal::{Shape, Shapes, levels};
use super::sights::{Sight, Sights};
use crate::capture::response::{Response, TERMS};
use crate::math::stats::quantile;
use glam::{DVec3, Vec3};
use std::collections::BTreeMap;

/// Reweightings of the fit at most, and the change of a logarithm that ends it.
const REWEIGHTINGS: usize = 30;
const STANDING: f64 = 1e-3;
/// Differences of logarithms below this count squared.
const NEAR: f64 = 0.03;
/// Cells that a photograph must share with others, for its exposure to be told.
pub(super) const LEAST_CELLS: usize = 30;

/// What of it may differ from one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Parts {
    pub exposures: bool,
    pub vignetting: bool,
    pub response: bool,
}

/// Logarithms of what turns radiance into the values of each photograph.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Logarithms {
    /// Of each photograph on the axis.
    pub exposures: Vec<DVec3>,
    /// The power by which all photographs are dimmed.
    pub power: DVec3,
    /// How values follow the light.
    pub response: Option<Response>,
}

impl Logarithms {
    /// Photographs that all show radiance.
    pub fn zero(frames: usize) -> Self {
        Self {
            exposures: vec![DVec3::ZERO; frames],
            power: DVec3::ZERO,
            response: None,
        }
    }

    /// What its photograph and the lens make of radiance on the way to the sensor.
    pub fn of(&self, sight: &Sight) -> DVec3 {
        self.exposures[sight.frame] + self.power * sight.off_axis
    }

    /// The radiance that a sight shows.
    pub fn radiance(&self, sight: &Sight) -> DVec3 {
        let light = match &self.response {
            None => sight.level,
            Some(response) => {
                let value = sight.level - sight.full;
                sight.full + by_channel(|c| response.log_light(c, value[c])[0])
            }
        };
        light - self.of(sight)
    }

    /// How the radiance that a sight shows grows with its value.
    pub fn slope(&self, sight: &Sight) -> DVec3 {
        match &self.response {
            None => DVec3::ONE,
            Some(response) => {
                let value = sight.level - sight.full;
                by_channel(|c| response.log_light(c, value[c])[1])
            }
        }
    }

    /// A sight's value over that of a radiance near its own.
    pub fn residual(&self, sight: &Sight, radiance: DVec3) -> DVec3 {
        (self.radiance(sight) - radiance) / self.slope(sight)
    }
}

fn by_channel(of: impl Fn(usize) -> f64) -> DVec3 {
    DVec3::from_array(std::array::from_fn(of))
}

/// Those with the least sum of absolute differences from the cells' levels, by iteratively reweighted least squares; zero where too
/// little is shared or nothing else is allowed.
///
/// The cells' levels are eliminated and all photographs solved for at once: found in turns, exposures that drift along a walk
/// through the room, where each photograph shares cells with its neighbours only, would take thousands of them.
pub(super) fn fit(sights: &[Sight], frames: usize, parts: Parts) -> Logarithms {
    let mut counts = vec![0usize; frames];
    for sight in sights {
        counts[sight.frame] += 1;
    }
    let mut told: Vec<usize> = (0..frames).collect();
    told.retain(|&frame| parts.exposures && counts[frame] >= LEAST_CELLS);
    let shape = Shape::new(told, frames, parts);
    let mut found = Logarithms::zero(frames);
    found.response = parts.response.then_some(Response {
        terms: [Vec3::ZERO; TERMS],
    });
    let mut weights = vec![DVec3::ONE; sights.len()];
    let shapes = Shapes::new(sights, parts);
    for _ in 0..REWEIGHTINGS {
        let Some(step) = shapes.solve(&weights, &shape) else {
            break;
        };
        let before = found.clone();
        for (exposure, &frame) in step.exposures.iter().zip(&shape.told) {
            found.exposures[frame] = *exposure;
        }
        found.power = step.power;
        if parts.response {
            found.response = Some(step.response());
        }
        let middle = median(shape.told.iter().map(|&frame| found.exposures[frame]));
        for &frame in &shape.told {
            found.exposures[frame] -= middle;
        }
        let exposures = found.exposures.iter().zip(&before.exposures);
        let changes = exposures
            .chain([(&found.power, &before.power)])
            .map(|(now, before)| (*now - *before).abs());
        let bends = (found.response.iter().zip(&before.response))
            .flat_map(|(now, before)| now.terms.into_iter().zip(before.terms))
            .map(|(now, before)| (now - before).as_dvec3().abs());
        if changes
            .chain(bends)
            .all(|change| change.max_element() < STANDING)
        {
            break;
        }
        // Differences count as those of values, which is where the noise is.
        let left = residuals(sights, &weights, &found);
        weights = (sights.iter().zip(&left))
            .map(|(sight, residual)| {
                let slope = found.slope(sight);
                (residual.abs().max(DVec3::splat(NEAR)) * slope * slope).recip()
            })
            .collect();
    }
    found
}

/// Sets the exposures of photographs that are held out to the median difference from the cells as the others show them, and
/// gives the differences of each that are left.
pub(super) fn compare(sights: &Sights, found: &mut Logarithms) -> BTreeMap<usize, Vec<DVec3>> {
    let levels = cell_levels(&sights.fitted, found);
    let cells = sights.fitted.iter().map(|s| s.cell);
    let level_of: BTreeMap<u64, DVec3> = cells.zip(levels).collect();
    let mut differences: BTreeMap<usize, Vec<DVec3>> = BTreeMap::new();
    for sight in &sights.held_out {
        if let Some(level) = level_of.get(&sight.cell) {
            let of_frame = differences.entry(sight.frame).or_default();
            of_frame.push(found.radiance(sight) - *level);
        }
    }
    differences.retain(|_, of_frame| of_frame.len() >= LEAST_CELLS);
    for (&frame, of_frame) in &mut differences {
        let exposure = median(of_frame.iter().copied());
        found.exposures[frame] = exposure;
        of_frame.iter_mut().for_each(|d| *d -= exposure);
    }
    differences
}

/// What is left of each sight after what its photograph does and the weighted mean level of its cell.
fn residuals(sights: &[Sight], weights: &[DVec3], found: &Logarithms) -> Vec<DVec3> {
    let levels = levels(sights, weights, found);
    let both = sights.iter().zip(&levels);
    both.map(|(s, level)| found.residual(s, *level)).collect()
}

/// For each sight, the median level of its cell.
fn cell_levels(sights: &[Sight], found: &Logarithms) -> Vec<DVec3> {
    let mut levels = Vec::with_capacity(sights.len());
    for cell in sights.chunk_by(|a, b| a.cell == b.cell) {
        let level = median(cell.iter().map(|s| found.radiance(s)));
        levels.extend(std::iter::repeat_n(level, cell.len()));
    }
    levels
}

/// For each cell, the absolute differences of logarithms between its sights and their median, summed over sights and channels.
pub(super) fn disagreements(sights: &[Sight], found: &Logarithms) -> Vec<f64> {
    let levels = cell_levels(sights, found);
    let differences: Vec<f64> = (sights.iter().zip(&levels))
        .map(|(s, level)| found.residual(s, *level).abs().element_sum())
        .collect();
    let mut rest = &differences[..];
    let cells = sights.chunk_by(|a, b| a.cell == b.cell);
    cells
        .map(|cell| {
            let (own, others) = rest.split_at(cell.len());
            rest = others;
            own.iter().sum()
        })
        .collect()
}

fn median(values: impl Iterator<Item = DVec3>) -> DVec3 {
    let all: Vec<DVec3> = values.collect();
    DVec3::from_array(std::array::from_fn(|channel| {
        let mut values: Vec<f64> = all.iter().map(|v| v[channel]).collect();
        quantile(&mut values, 0.5).unwrap_or(0.0)
    }))
}
