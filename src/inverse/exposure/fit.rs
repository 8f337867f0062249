//! Least absolute differences between what photographs show of the same cells.

use super::sights::{Sight, Sights};
use crate::math::stats::quantile;
use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;

/// Reweightings of the fit at most, and the change of a logarithm that ends it.
const REWEIGHTINGS: usize = 30;
const STANDING: f64 = 1e-3;
/// Differences of logarithms below this count squared.
const NEAR: f64 = 0.03;
/// Relative weight that keeps what is open near zero.
const OPEN: f64 = 1e-9;
/// Cells that a photograph must share with others, for its exposure to be told.
pub(super) const LEAST_CELLS: usize = 30;

/// What of it may differ from one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Parts {
    pub exposures: bool,
    pub vignetting: bool,
}

/// Logarithms of what turns radiance into the values of each photograph.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Logarithms {
    /// Of each photograph on the axis.
    pub exposures: Vec<DVec3>,
    /// The power by which all photographs are dimmed.
    pub power: DVec3,
}

impl Logarithms {
    /// Photographs that all show radiance.
    pub fn zero(frames: usize) -> Self {
        Self {
            exposures: vec![DVec3::ZERO; frames],
            power: DVec3::ZERO,
        }
    }

    /// What its photograph does to a sight.
    fn of(&self, sight: &Sight) -> DVec3 {
        self.exposures[sight.frame] + self.power * sight.off_axis
    }
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
    let mut place = vec![None; frames];
    for (row, &frame) in told.iter().enumerate() {
        place[frame] = Some(row);
    }
    let shape = Shape {
        place,
        exposures: told.len(),
        vignetting: parts.vignetting,
    };
    let mut found = Logarithms::zero(frames);
    let mut weights = vec![DVec3::ONE; sights.len()];
    for _ in 0..REWEIGHTINGS {
        let solved = [0, 1, 2].map(|channel| {
            let Normal { matrix, right } = Normal::new(sights, &weights, &shape, channel);
            matrix.cholesky().map(|factor| factor.solve(&right))
        });
        let [Some(r), Some(g), Some(b)] = &solved else {
            break;
        };
        let row = |row: usize| DVec3::new(r[row], g[row], b[row]);
        let before = found.clone();
        for (k, &frame) in told.iter().enumerate() {
            found.exposures[frame] = row(k);
        }
        if shape.vignetting {
            found.power = row(shape.exposures);
        }
        let middle = median(told.iter().map(|&frame| found.exposures[frame]));
        for &frame in &told {
            found.exposures[frame] -= middle;
        }
        let exposures = found.exposures.iter().zip(&before.exposures);
        let mut changes = exposures
            .chain([(&found.power, &before.power)])
            .map(|(now, before)| (*now - *before).abs());
        if changes.all(|change| change.max_element() < STANDING) {
            break;
        }
        let left = residuals(sights, &weights, &found);
        weights = left
            .iter()
            .map(|r| r.abs().max(DVec3::splat(NEAR)).recip())
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
            of_frame.push(sight.level - found.power * sight.off_axis - *level);
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

/// Where the unknowns stand: the row of each photograph that has one, then vignetting's power.
struct Shape {
    place: Vec<Option<usize>>,
    exposures: usize,
    vignetting: bool,
}

/// The weighted normal equations of one channel, without the cells' levels.
struct Normal {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

impl Normal {
    fn new(sights: &[Sight], weights: &[DVec3], shape: &Shape, channel: usize) -> Self {
        let rows = shape.exposures + usize::from(shape.vignetting);
        let power = shape.exposures;
        let mut matrix = DMatrix::zeros(rows, rows);
        let mut right = DVector::zeros(rows);
        for (cell, weights) in cells(sights, weights) {
            let weighed = || {
                cell.iter()
                    .zip(weights)
                    .map(move |(sight, w)| (sight, w[channel]))
            };
            let total: f64 = weighed().map(|(_, w)| w).sum();
            let level = weighed().map(|(s, w)| w * s.level[channel]).sum::<f64>() / total;
            let off_axis = weighed().map(|(s, w)| w * s.off_axis).sum::<f64>() / total;
            for (a, wa) in weighed() {
                let from_level = a.level[channel] - level;
                let from_axis = a.off_axis - off_axis;
                if shape.vignetting {
                    matrix[(power, power)] += wa * from_axis * from_axis;
                    right[power] += wa * from_axis * from_level;
                }
                let Some(row) = shape.place[a.frame] else {
                    continue;
                };
                matrix[(row, row)] += wa;
                right[row] += wa * from_level;
                for (b, wb) in weighed() {
                    if let Some(column) = shape.place[b.frame] {
                        matrix[(row, column)] -= wa * wb / total;
                    }
                }
                if shape.vignetting {
                    matrix[(row, power)] += wa * from_axis;
                    matrix[(power, row)] += wa * from_axis;
                }
            }
        }
        // What all photographs share, and each group of them that shares nothing with the others, is open; so is vignetting where
        // all see a cell at one angle from the axis.
        let scale = (0..rows).map(|row| matrix[(row, row)]).sum::<f64>() / rows.max(1) as f64;
        for row in 0..rows {
            matrix[(row, row)] += OPEN * (matrix[(row, row)] + scale);
        }
        Self { matrix, right }
    }
}

/// The sights of one cell after the other, with their weights.
fn cells<'a>(
    sights: &'a [Sight],
    mut weights: &'a [DVec3],
) -> impl Iterator<Item = (&'a [Sight], &'a [DVec3])> {
    sights.chunk_by(|a, b| a.cell == b.cell).map(move |cell| {
        let (own, others) = weights.split_at(cell.len());
        weights = others;
        (cell, own)
    })
}

/// What is left of each sight after what its photograph does and the weighted mean level of its cell.
fn residuals(sights: &[Sight], weights: &[DVec3], found: &Logarithms) -> Vec<DVec3> {
    let mut left = Vec::with_capacity(sights.len());
    for (cell, weights) in cells(sights, weights) {
        let (sum, total) = (cell.iter().zip(weights))
            .fold((DVec3::ZERO, DVec3::ZERO), |(sum, total), (s, w)| {
                (sum + *w * (s.level - found.of(s)), total + *w)
            });
        let level = sum / total;
        left.extend(cell.iter().map(|s| s.level - found.of(s) - level));
    }
    left
}

/// For each sight, the median level of its cell.
fn cell_levels(sights: &[Sight], found: &Logarithms) -> Vec<DVec3> {
    let mut levels = Vec::with_capacity(sights.len());
    for cell in sights.chunk_by(|a, b| a.cell == b.cell) {
        let level = median(cell.iter().map(|s| s.level - found.of(s)));
        levels.extend(std::iter::repeat_n(level, cell.len()));
    }
    levels
}

/// For each cell, the absolute differences of logarithms between its sights and their median, summed over sights and channels.
pub(super) fn disagreements(sights: &[Sight], found: &Logarithms) -> Vec<f64> {
    let levels = cell_levels(sights, found);
    let differences: Vec<f64> = (sights.iter().zip(&levels))
        .map(|(s, level)| (s.level - found.of(s) - *level).abs().element_sum())
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
