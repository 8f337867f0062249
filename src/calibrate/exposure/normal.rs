//! The normal equations of what photographs do to the surfaces that they share.

use crate::calibrate::exposure::fit::{Logarithms, Parts};
use crate::calibrate::exposure::observations::Observation;
use crate::capture::response::{Response, TERMS};
use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Relative weight that keeps what is open near zero.
const OPEN: f64 = 1e-9;
/// Halvings of the interval in which the greatest possible fraction of a response lies.
const HALVINGS: usize = 12;

/// Where the unknowns stand: the row of each photograph that has one, then vignetting's power, then the response's terms.
pub(super) struct Shape {
    /// The photographs that have rows, in order.
    pub told: Vec<usize>,
    place: Vec<Option<usize>>,
    vignetting: bool,
    /// Whether the response has terms, and whether the power is one of them.
    response: Option<bool>,
}

impl Shape {
    /// Rows for the photographs in `told` and what else may differ from one. Exposures that are not known leave the response's
    /// power open.
    pub fn new(told: Vec<usize>, frames: usize, parts: Parts) -> Self {
        let mut place = vec![None; frames];
        for (row, &frame) in told.iter().enumerate() {
            place[frame] = Some(row);
        }
        Self {
            told,
            place,
            vignetting: parts.vignetting,
            response: parts.response.then_some(!parts.exposures),
        }
    }

    fn rows(&self) -> usize {
        let terms = match self.response {
            None => 0,
            Some(power) => TERMS - usize::from(!power),
        };
        self.told.len() + usize::from(self.vignetting) + terms
    }
}

/// What a camera's response may do to each observation.
pub(super) struct Shapes<'a> {
    observations: &'a [Observation],
    /// The response's shapes at the value of each observation; empty where there is no response.
    of_observations: Vec<[DVec3; TERMS]>,
    /// How much of each of them a power would explain.
    powers: [DVec3; TERMS],
}

impl<'a> Shapes<'a> {
    /// Those of the observations.
    pub fn new(observations: &'a [Observation], parts: Parts) -> Self {
        let of_observations: Vec<[DVec3; TERMS]> = match parts.response {
            true => observations.par_iter().map(shapes).collect(),
            false => Vec::new(),
        };
        Self {
            observations,
            powers: powers(&of_observations),
            of_observations,
        }
    }

    /// The least-squares unknowns of all channels; `None` where one has none.
    pub fn solve(&self, weights: &[DVec3], shape: &Shape) -> Option<ExposureUnknowns> {
        let [Some(r), Some(g), Some(b)] = [0, 1, 2].map(|channel| {
            let Normal { matrix, right } = self.normal(weights, shape, channel);
            matrix.cholesky().map(|factor| factor.solve(&right))
        }) else {
            return None;
        };
        let row = |row: usize| DVec3::new(r[row], g[row], b[row]);
        let exposures = shape.told.len();
        let first = exposures + usize::from(shape.vignetting);
        Some(ExposureUnknowns {
            exposures: (0..exposures).map(row).collect(),
            power: if shape.vignetting {
                row(exposures)
            } else {
                DVec3::ZERO
            },
            terms: match shape.response {
                None => [DVec3::ZERO; TERMS],
                Some(true) => std::array::from_fn(|term| row(first + term)),
                Some(false) => {
                    let [root, linear] = [row(first), row(first + 1)];
                    let power = -(root * self.powers[1] + linear * self.powers[2]);
                    [power, root, linear]
                }
            },
        })
    }

    /// How what stands for a observation's value grows with each unknown.
    fn columns(
        &self,
        shape: &Shape,
        index: usize,
        channel: usize,
    ) -> impl Iterator<Item = (usize, f64)> + use<> {
        let observation = &self.observations[index];
        let power = shape.told.len();
        let first = power + usize::from(shape.vignetting);
        let skipped = usize::from(shape.response == Some(false));
        let powers = self.powers.map(|of_channel| of_channel[channel]);
        let bends = shape.response.map(|_| {
            let shapes = self.of_observations[index].map(|of_channel| of_channel[channel]);
            (skipped..TERMS).map(move |term| {
                let without = if skipped > 0 {
                    powers[term] * shapes[0]
                } else {
                    0.0
                };
                (first + term - skipped, without - shapes[term])
            })
        });
        let exposure = shape.place[observation.frame].map(|row| (row, 1.0));
        let dimmed = shape.vignetting.then_some((power, observation.off_axis));
        (exposure.into_iter())
            .chain(dimmed)
            .chain(bends.into_iter().flatten())
    }

    /// The weighted normal equations of one channel, without the cells' levels.
    fn normal(&self, weights: &[DVec3], shape: &Shape, channel: usize) -> Normal {
        let rows = shape.rows();
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
                for (row, grown) in self.columns(shape, index, channel) {
                    right[row] += weight * grown * target;
                    for (column, other) in self.columns(shape, index, channel) {
                        matrix[(row, column)] += weight * grown * other;
                    }
                    match with_level.iter_mut().find(|(known, _)| *known == row) {
                        Some((_, sum)) => *sum += weight * grown,
                        None => with_level.push((row, weight * grown)),
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
        // What all photographs share, and each group of them that shares nothing with the others, is open; so is vignetting where
        // all see a cell at one angle from the axis.
        let scale = (0..rows).map(|row| matrix[(row, row)]).sum::<f64>() / rows.max(1) as f64;
        for row in 0..rows {
            matrix[(row, row)] += OPEN * (matrix[(row, row)] + scale);
        }
        Normal { matrix, right }
    }
}

/// What a step finds.
pub(super) struct ExposureUnknowns {
    /// Of the photographs that have rows.
    pub exposures: Vec<DVec3>,
    pub power: DVec3,
    pub terms: [DVec3; TERMS],
}

struct Normal {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

/// For each observation the weighted mean of the radiance that its cell's observations show.
pub(super) fn levels(
    observations: &[Observation],
    weights: &[DVec3],
    found: &Logarithms,
) -> Vec<DVec3> {
    let mut levels = Vec::with_capacity(observations.len());
    for cell in observations.chunk_by(|a, b| a.cell == b.cell) {
        let own = cell.iter().zip(&weights[levels.len()..]);
        let (sum, total) = own.fold((DVec3::ZERO, DVec3::ZERO), |(sum, total), (s, w)| {
            (sum + *w * found.radiance(s), total + *w)
        });
        levels.extend(std::iter::repeat_n(sum / total, cell.len()));
    }
    levels
}

fn shapes(observation: &Observation) -> [DVec3; TERMS] {
    let of_channels = (observation.level - observation.full)
        .to_array()
        .map(Response::basis);
    std::array::from_fn(|term| DVec3::from_array(of_channels.map(|shape| shape[term][0])))
}

/// The slope of each shape over the logarithm of the value, over all observations.
fn powers(of_observations: &[[DVec3; TERMS]]) -> [DVec3; TERMS] {
    let mean = |of: &dyn Fn(&[DVec3; TERMS]) -> DVec3| {
        of_observations.iter().map(of).sum::<DVec3>() / of_observations.len().max(1) as f64
    };
    let value = mean(&|shapes| shapes[0]);
    let variance = mean(&|shapes| (shapes[0] - value) * (shapes[0] - value));
    std::array::from_fn(|term| {
        let slope = mean(&|shapes| shapes[term] * (shapes[0] - value)) / variance;
        DVec3::select(slope.is_finite_mask(), slope, DVec3::ZERO)
    })
}

impl ExposureUnknowns {
    /// The response of the terms, as far towards it as one is possible.
    pub fn response(&self) -> Response {
        let fraction = |fraction: f64| Response {
            terms: self.terms.map(|term| (term * fraction).as_vec3()),
        };
        let whole = fraction(1.0);
        if whole.is_possible() {
            return whole;
        }
        // Slopes are linear in the terms, so that what is possible has one end.
        let [mut least, mut most] = [0.0, 1.0];
        for _ in 0..HALVINGS {
            let middle = 0.5 * (least + most);
            if fraction(middle).is_possible() {
                least = middle;
            } else {
                most = middle;
            }
        }
        fraction(least)
    }
}
