//! Least absolute differences between what photographs show of the same cells.

use crate::calibrate::exposure::normal::{Shape, Shapes, levels};
use crate::calibrate::exposure::observations::{Observation, Observations};
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
pub(super) const MIN_CELLS: usize = 30;

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
    pub fn of(&self, observation: &Observation) -> DVec3 {
        self.exposures[observation.frame] + self.power * observation.off_axis
    }

    /// The radiance that a observation shows.
    pub fn radiance(&self, observation: &Observation) -> DVec3 {
        let light = match &self.response {
            None => observation.level,
            Some(response) => {
                let value = observation.level - observation.full;
                observation.full + by_channel(|c| response.log_light(c, value[c])[0])
            }
        };
        light - self.of(observation)
    }

    /// How the radiance that a observation shows grows with its value.
    pub fn slope(&self, observation: &Observation) -> DVec3 {
        match &self.response {
            None => DVec3::ONE,
            Some(response) => {
                let value = observation.level - observation.full;
                by_channel(|c| response.log_light(c, value[c])[1])
            }
        }
    }

    /// A observation's value over that of a radiance near its own.
    pub fn residual(&self, observation: &Observation, radiance: DVec3) -> DVec3 {
        (self.radiance(observation) - radiance) / self.slope(observation)
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
pub(super) fn fit(observations: &[Observation], frames: usize, parts: Parts) -> Logarithms {
    let mut counts = vec![0usize; frames];
    for observation in observations {
        counts[observation.frame] += 1;
    }
    let mut told: Vec<usize> = (0..frames).collect();
    told.retain(|&frame| parts.exposures && counts[frame] >= MIN_CELLS);
    let shape = Shape::new(told, frames, parts);
    let mut found = Logarithms::zero(frames);
    found.response = parts.response.then_some(Response {
        terms: [Vec3::ZERO; TERMS],
    });
    let mut weights = vec![DVec3::ONE; observations.len()];
    let shapes = Shapes::new(observations, parts);
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
        let left = residuals(observations, &weights, &found);
        weights = (observations.iter().zip(&left))
            .map(|(observation, residual)| {
                let slope = found.slope(observation);
                (residual.abs().max(DVec3::splat(NEAR)) * slope * slope).recip()
            })
            .collect();
    }
    found
}

/// Sets the exposures of photographs that are held out to the median difference from the cells as the others show them, and
/// gives the differences of each that are left.
pub(super) fn compare(
    observations: &Observations,
    found: &mut Logarithms,
) -> BTreeMap<usize, Vec<DVec3>> {
    let levels = cell_levels(&observations.fitted, found);
    let cells = observations.fitted.iter().map(|s| s.cell);
    let level_of: BTreeMap<u64, DVec3> = cells.zip(levels).collect();
    let mut differences: BTreeMap<usize, Vec<DVec3>> = BTreeMap::new();
    for observation in &observations.held_out {
        if let Some(level) = level_of.get(&observation.cell) {
            let of_frame = differences.entry(observation.frame).or_default();
            of_frame.push(found.radiance(observation) - *level);
        }
    }
    differences.retain(|_, of_frame| of_frame.len() >= MIN_CELLS);
    for (&frame, of_frame) in &mut differences {
        let exposure = median(of_frame.iter().copied());
        found.exposures[frame] = exposure;
        of_frame.iter_mut().for_each(|d| *d -= exposure);
    }
    differences
}

/// What is left of each observation after what its photograph does and the weighted mean level of its cell.
fn residuals(observations: &[Observation], weights: &[DVec3], found: &Logarithms) -> Vec<DVec3> {
    let levels = levels(observations, weights, found);
    let both = observations.iter().zip(&levels);
    both.map(|(s, level)| found.residual(s, *level)).collect()
}

/// For each observation, the median level of its cell.
fn cell_levels(observations: &[Observation], found: &Logarithms) -> Vec<DVec3> {
    let mut levels = Vec::with_capacity(observations.len());
    for cell in observations.chunk_by(|a, b| a.cell == b.cell) {
        let level = median(cell.iter().map(|s| found.radiance(s)));
        levels.extend(std::iter::repeat_n(level, cell.len()));
    }
    levels
}

/// For each cell, the absolute differences of logarithms between its observations and their median, summed over observations and channels.
pub(super) fn disagreements(observations: &[Observation], found: &Logarithms) -> Vec<f64> {
    let levels = cell_levels(observations, found);
    let differences: Vec<f64> = (observations.iter().zip(&levels))
        .map(|(s, level)| found.residual(s, *level).abs().element_sum())
        .collect();
    let mut rest = &differences[..];
    let cells = observations.chunk_by(|a, b| a.cell == b.cell);
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
