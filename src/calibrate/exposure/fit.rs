//! Fits exposures, vignetting and response to observations by least absolute deviations.

use crate::calibrate::exposure::normal::{Equations, levels};
use crate::calibrate::exposure::observations::{Observation, Observations};
use crate::capture::response::Response;
use crate::math::stats::medians;
use glam::DVec3;
use std::collections::BTreeMap;

/// Greatest number of reweighted solves.
const MAX_ITERATIONS: usize = 30;
/// The fit ends when no unknown changes by more than this.
const CONVERGED: f64 = 1e-3;
/// Log differences below this are weighted as squares.
const NEAR: f64 = 0.03;
/// Least number of cells that a photograph must share with others for its exposure to be fitted.
pub(super) const MIN_CELLS: usize = 30;

#[derive(Debug, Clone, Copy)]
pub(super) struct ModelParts {
    pub exposures: bool,
    pub vignetting: bool,
    pub response: bool,
}

impl ModelParts {
    pub const EXPOSURES: Self = Self {
        exposures: true,
        vignetting: false,
        response: false,
    };
}

/// The map from radiance to the values of each photograph, in logarithms.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CameraModel {
    /// Log exposure of each photograph on the optical axis.
    pub exposures: Vec<DVec3>,
    /// Exponent of the vignetting of all photographs.
    pub power: DVec3,
    pub response: Option<Response>,
}

impl CameraModel {
    /// Photographs whose values are radiance.
    pub fn identity(frames: usize) -> Self {
        Self {
            exposures: vec![DVec3::ZERO; frames],
            power: DVec3::ZERO,
            response: None,
        }
    }

    /// Log factor between radiance and light on the sensor: exposure and vignetting.
    pub fn factor(&self, observation: &Observation) -> DVec3 {
        self.exposures[observation.frame] + self.power * observation.off_axis
    }

    /// Log radiance of an observation.
    pub fn radiance(&self, observation: &Observation) -> DVec3 {
        self.light(observation)[0] - self.factor(observation)
    }

    /// Derivative of an observation's log radiance with respect to its log value.
    pub fn slope(&self, observation: &Observation) -> DVec3 {
        self.light(observation)[1]
    }

    /// Log light of an observation on the sensor, and its derivative with respect to the log value.
    fn light(&self, observation: &Observation) -> [DVec3; 2] {
        let Some(response) = &self.response else {
            return [observation.level, DVec3::ONE];
        };
        let value = observation.level - observation.saturation;
        let channels = [0, 1, 2].map(|c| response.log_light(c, value[c]));
        let [light, slope] = [0, 1].map(|i| DVec3::from_array(channels.map(|c| c[i])));
        [observation.saturation + light, slope]
    }

    /// Difference of an observation's log value from the one that log `radiance` would give, to first order.
    pub fn residual(&self, observation: &Observation, radiance: DVec3) -> DVec3 {
        (self.radiance(observation) - radiance) / self.slope(observation)
    }
}

/// The model with the least sum of absolute differences from the cells' levels, by iteratively reweighted least squares. Parts
/// that are not fitted, and exposures of photographs that share too few cells, stay at zero.
///
/// The cells' levels are eliminated and all unknowns solved for at once. Alternating between both would take thousands of
/// iterations for exposures that drift along a walk where each photograph shares cells with its neighbours only.
pub(super) fn fit(observations: &[Observation], frames: usize, parts: ModelParts) -> CameraModel {
    let equations = Equations::new(observations, frames, parts);
    let mut model = CameraModel::identity(frames);
    model.response = parts.response.then(Response::default);
    let mut weights = vec![DVec3::ONE; observations.len()];
    for _ in 0..MAX_ITERATIONS {
        let Some(mut next) = equations.solve(&weights) else {
            break;
        };
        let fitted = || equations.frames.iter();
        let middle = medians(fitted().map(|&frame| next.exposures[frame]));
        fitted().for_each(|&frame| next.exposures[frame] -= middle);
        let before = std::mem::replace(&mut model, next);
        let exposures = model.exposures.iter().zip(&before.exposures);
        let changes = exposures
            .chain([(&model.power, &before.power)])
            .map(|(now, before)| (*now - *before).abs());
        let response_changes = (model.response.iter().zip(&before.response))
            .flat_map(|(now, before)| now.terms.into_iter().zip(before.terms))
            .map(|(now, before)| (now - before).as_dvec3().abs());
        if changes
            .chain(response_changes)
            .all(|change| change.max_element() < CONVERGED)
        {
            break;
        }
        // Absolute differences of values, which is where the noise is, hence the squared slope.
        let levels = levels(observations, &weights, &model);
        weights = (observations.iter().zip(levels))
            .map(|(observation, level)| {
                let residual = model.residual(observation, level).abs();
                let slope = model.slope(observation);
                (residual.max(DVec3::splat(NEAR)) * slope * slope).recip()
            })
            .collect();
    }
    model
}

/// Sets the exposures of held-out photographs to their median log difference from the fitted cells; returns what remains of each.
pub(super) fn fit_held_out(
    observations: &Observations,
    model: &mut CameraModel,
) -> BTreeMap<usize, Vec<DVec3>> {
    let cells = observations.fitted.chunk_by(|a, b| a.cell == b.cell);
    let level_of: BTreeMap<u64, DVec3> = cells
        .map(|cell| (cell[0].cell, median_level(cell, model)))
        .collect();
    let mut differences: BTreeMap<usize, Vec<DVec3>> = BTreeMap::new();
    for observation in &observations.held_out {
        if let Some(level) = level_of.get(&observation.cell) {
            let differences = differences.entry(observation.frame).or_default();
            differences.push(model.radiance(observation) - *level);
        }
    }
    differences.retain(|_, differences| differences.len() >= MIN_CELLS);
    for (&frame, differences) in &mut differences {
        let exposure = medians(differences.iter().copied());
        model.exposures[frame] = exposure;
        differences.iter_mut().for_each(|d| *d -= exposure);
    }
    differences
}

fn median_level(cell: &[Observation], model: &CameraModel) -> DVec3 {
    medians(cell.iter().map(|s| model.radiance(s)))
}

/// For each cell, the sum over observations and channels of the absolute residuals from the cell's median.
pub(super) fn disagreements(observations: &[Observation], model: &CameraModel) -> Vec<f64> {
    (observations.chunk_by(|a, b| a.cell == b.cell))
        .map(|cell| {
            let level = median_level(cell, model);
            let residuals = cell.iter().map(|s| model.residual(s, level));
            residuals.map(|r| r.abs().element_sum()).sum()
        })
        .collect()
}
