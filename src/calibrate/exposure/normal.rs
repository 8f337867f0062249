//! Normal equations of the camera model's unknowns, with the levels of the cells eliminated.

use crate::calibrate::exposure::fit::{CameraModel, MIN_CELLS, ModelParts};
use crate::calibrate::exposure::observations::Observation;
use crate::capture::response::{Response, TERMS};
use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Relative regularization that keeps undetermined unknowns near zero.
const RIDGE: f64 = 1e-9;
/// Bisection steps for the largest valid fraction of a response.
const BISECTIONS: usize = 12;

/// The least-squares equations of the camera model's unknowns, in the order of exposures of the fitted photographs, vignetting's
/// power, the response's terms.
pub(super) struct Equations<'a> {
    observations: &'a [Observation],
    /// The photographs whose exposure is fitted, in order of their rows.
    pub frames: Vec<usize>,
    /// Row of each photograph's exposure.
    row_of: Vec<Option<usize>>,
    vignetting: bool,
    /// `None` without a response; otherwise whether its power term is fitted. It is undetermined if exposures are fitted.
    response: Option<bool>,
    /// The basis functions ([`Response::basis`]) at the value of each observation; empty without a response.
    values: Vec<[DVec3; TERMS]>,
    /// Slope of each basis function over the power term, by linear regression over all observations.
    powers: [DVec3; TERMS],
}

impl<'a> Equations<'a> {
    /// Equations of `parts` for `frames` photographs. Exposures of photographs that share too few cells are not fitted.
    pub fn new(observations: &'a [Observation], frames: usize, parts: ModelParts) -> Self {
        let mut counts = vec![0usize; frames];
        for observation in observations {
            counts[observation.frame] += 1;
        }
        let mut fitted: Vec<usize> = (0..frames).collect();
        fitted.retain(|&frame| parts.exposures && counts[frame] >= MIN_CELLS);
        let mut row_of = vec![None; frames];
        for (row, &frame) in fitted.iter().enumerate() {
            row_of[frame] = Some(row);
        }
        let values: Vec<[DVec3; TERMS]> = match parts.response {
            true => observations.par_iter().map(basis).collect(),
            false => Vec::new(),
        };
        Self {
            observations,
            frames: fitted,
            row_of,
            vignetting: parts.vignetting,
            response: parts.response.then_some(!parts.exposures),
            powers: powers(&values),
            values,
        }
    }

    fn rows(&self) -> usize {
        let terms = match self.response {
            None => 0,
            Some(power) => TERMS - usize::from(!power),
        };
        self.frames.len() + usize::from(self.vignetting) + terms
    }

    /// The weighted least-squares model, its response scaled down as far as needed to make it valid; `None` if a channel's matrix
    /// is singular.
    pub fn solve(&self, weights: &[DVec3]) -> Option<CameraModel> {
        let [Some(r), Some(g), Some(b)] = [0, 1, 2].map(|channel| {
            let (matrix, right) = self.normal(weights, channel);
            matrix.cholesky().map(|factor| factor.solve(&right))
        }) else {
            return None;
        };
        let row = |row: usize| DVec3::new(r[row], g[row], b[row]);
        let power = self.frames.len();
        let first = power + usize::from(self.vignetting);
        Some(CameraModel {
            exposures: (self.row_of.iter())
                .map(|exposure| exposure.map_or(DVec3::ZERO, row))
                .collect(),
            power: match self.vignetting {
                true => row(power),
                false => DVec3::ZERO,
            },
            response: self.response.map(|has_power| {
                valid_response(match has_power {
                    true => std::array::from_fn(|term| row(first + term)),
                    false => {
                        let [root, linear] = [row(first), row(first + 1)];
                        let power = -(root * self.powers[1] + linear * self.powers[2]);
                        [power, root, linear]
                    }
                })
            }),
        })
    }

    /// The non-zero entries of an observation's row of the design matrix: unknown and derivative.
    fn columns(&self, index: usize, channel: usize) -> impl Iterator<Item = (usize, f64)> + use<> {
        let observation = &self.observations[index];
        let power = self.frames.len();
        let first = power + usize::from(self.vignetting);
        let skipped = usize::from(self.response == Some(false));
        let powers = self.powers.map(|rgb| rgb[channel]);
        let response = self.response.map(|_| {
            let basis = self.values[index].map(|rgb| rgb[channel]);
            (skipped..TERMS).map(move |term| {
                // The power term is projected out of the other terms if it is not fitted.
                let projected = match skipped {
                    0 => 0.0,
                    _ => powers[term] * basis[0],
                };
                (first + term - skipped, projected - basis[term])
            })
        });
        let exposure = self.row_of[observation.frame].map(|row| (row, 1.0));
        let vignetting = self.vignetting.then_some((power, observation.off_axis));
        (exposure.into_iter())
            .chain(vignetting)
            .chain(response.into_iter().flatten())
    }

    /// The weighted normal equations of one channel, with the cells' levels eliminated by the Schur complement.
    fn normal(&self, weights: &[DVec3], channel: usize) -> (DMatrix<f64>, DVector<f64>) {
        let rows = self.rows();
        let mut matrix = DMatrix::zeros(rows, rows);
        let mut right = DVector::zeros(rows);
        let mut with_level: Vec<(usize, f64)> = Vec::new();
        let mut first = 0;
        for cell in self.observations.chunk_by(|a, b| a.cell == b.cell) {
            with_level.clear();
            let (mut total, mut level) = (0.0, 0.0);
            for (index, observation) in (first..).zip(cell) {
                let (weight, target) = (weights[index][channel], observation.level[channel]);
                total += weight;
                level += weight * target;
                for (row, derivative) in self.columns(index, channel) {
                    right[row] += weight * derivative * target;
                    for (column, other) in self.columns(index, channel) {
                        matrix[(row, column)] += weight * derivative * other;
                    }
                    match with_level.iter_mut().find(|(known, _)| *known == row) {
                        Some((_, sum)) => *sum += weight * derivative,
                        None => with_level.push((row, weight * derivative)),
                    }
                }
            }
            for &(row, own) in &with_level {
                right[row] -= own * level / total;
                for &(column, other) in &with_level {
                    matrix[(row, column)] -= own * other / total;
                }
            }
            first += cell.len();
        }
        // Undetermined are: the common exposure of each connected group of photographs, and vignetting if each cell is always
        // seen at one angle from the axis.
        let scale = (0..rows).map(|row| matrix[(row, row)]).sum::<f64>() / rows.max(1) as f64;
        for row in 0..rows {
            matrix[(row, row)] += RIDGE * (matrix[(row, row)] + scale);
        }
        (matrix, right)
    }
}

/// For each observation, the weighted mean log radiance of its cell.
pub(super) fn levels(
    observations: &[Observation],
    weights: &[DVec3],
    model: &CameraModel,
) -> Vec<DVec3> {
    let mut levels = Vec::with_capacity(observations.len());
    for cell in observations.chunk_by(|a, b| a.cell == b.cell) {
        let own = cell.iter().zip(&weights[levels.len()..]);
        let (sum, total) = own.fold((DVec3::ZERO, DVec3::ZERO), |(sum, total), (s, w)| {
            (sum + *w * model.radiance(s), total + *w)
        });
        levels.extend(std::iter::repeat_n(sum / total, cell.len()));
    }
    levels
}

/// The response's basis functions at an observation's value.
fn basis(observation: &Observation) -> [DVec3; TERMS] {
    let rgb = (observation.level - observation.saturation)
        .to_array()
        .map(Response::basis);
    std::array::from_fn(|term| DVec3::from_array(rgb.map(|basis| basis[term][0])))
}

/// The slope of each basis function over the first one, the logarithm of the value, by linear regression.
fn powers(values: &[[DVec3; TERMS]]) -> [DVec3; TERMS] {
    let mean = |f: &dyn Fn(&[DVec3; TERMS]) -> DVec3| {
        values.iter().map(f).sum::<DVec3>() / values.len().max(1) as f64
    };
    let value = mean(&|basis| basis[0]);
    let variance = mean(&|basis| (basis[0] - value) * (basis[0] - value));
    std::array::from_fn(|term| {
        let slope = mean(&|basis| basis[term] * (basis[0] - value)) / variance;
        DVec3::select(slope.is_finite_mask(), slope, DVec3::ZERO)
    })
}

/// The response with these terms, scaled down as far as needed to make it valid.
fn valid_response(terms: [DVec3; TERMS]) -> Response {
    let scaled = |fraction: f64| Response {
        terms: terms.map(|term| (term * fraction).as_vec3()),
    };
    if scaled(1.0).is_possible() {
        return scaled(1.0);
    }
    // Slopes are linear in the terms, so the valid fractions form an interval from 0.
    let [mut low, mut high] = [0.0, 1.0];
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        match scaled(middle).is_possible() {
            true => low = middle,
            false => high = middle,
        }
    }
    scaled(low)
}
