//! The matrix Σ ω w wᵀ of measurements, summed once so that each product reads a cell's neighbours and not all its pixels.

use crate::inverse::texture::observations::{Observations, row_range};
use glam::{Vec3, Vec3A};
use rayon::prelude::*;

/// Number of cells in a part.
const PART: usize = 4096;
/// Mark of a cell without an entry in the present row.
const NONE: u32 = u32::MAX;

/// The matrix, per channel.
#[derive(Debug, Clone)]
pub struct NormalMatrix {
    /// The diagonal.
    pub diagonal: Vec<Vec3>,
    /// The other entries, [`PART`] cells each.
    parts: Vec<Part>,
}

/// Entries of consecutive cells in compressed sparse rows.
#[derive(Debug, Clone, Default)]
struct Part {
    ends: Vec<u32>,
    cells: Vec<u32>,
    values: Vec<Vec3A>,
}

impl NormalMatrix {
    /// From the weights w of cells in each measurement and the weight ω of each measurement, per channel.
    pub fn new(observations: &Observations, row_weights: &[Vec3]) -> Self {
        let count = observations.cells();
        let parts: Vec<Part> = (0..count.div_ceil(PART))
            .into_par_iter()
            .map(|part| {
                let cells = part * PART..count.min((part + 1) * PART);
                Part::new(observations, row_weights, cells)
            })
            .collect();
        Self {
            diagonal: observations.diagonal(row_weights),
            parts,
        }
    }

    /// For each cell, `rest` plus the product of its row and `x`, in `result`.
    pub fn product(
        &self,
        x: &[Vec3A],
        rest: impl Fn(usize) -> Vec3A + Sync,
        result: &mut Vec<Vec3A>,
    ) {
        result.resize(x.len(), Vec3A::ZERO);
        (result.par_chunks_mut(PART).zip(&self.parts).enumerate()).for_each(
            |(index, (result, part))| {
                for (row, result) in result.iter_mut().enumerate() {
                    let cell = index * PART + row;
                    let entries = row_range(&part.ends, row);
                    let others: Vec3A = (part.cells[entries.clone()].iter())
                        .zip(&part.values[entries])
                        .map(|(&other, value)| x[other as usize] * *value)
                        .sum();
                    *result = others + x[cell] * Vec3A::from(self.diagonal[cell]) + rest(cell);
                }
            },
        );
    }
}

impl Part {
    fn new(
        observations: &Observations,
        row_weights: &[Vec3],
        cells: std::ops::Range<usize>,
    ) -> Self {
        let mut part = Self::default();
        // Where the entry of each other cell is in the present row.
        let mut slots = vec![NONE; observations.cells()];
        for cell in cells {
            let start = part.cells.len();
            for (row, weight) in observations.column(cell) {
                let weighted = Vec3A::from(row_weights[row]) * weight;
                for (other, weight) in observations.row(row).filter(|&(other, _)| other != cell) {
                    if slots[other] == NONE {
                        slots[other] = part.cells.len() as u32;
                        part.cells.push(other as u32);
                        part.values.push(Vec3A::ZERO);
                    }
                    part.values[slots[other] as usize] += weighted * weight;
                }
            }
            for &other in &part.cells[start..] {
                slots[other as usize] = NONE;
            }
            part.ends.push(part.cells.len() as u32);
        }
        part
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;

    #[test]
    fn its_product_is_that_of_the_measurements() {
        let cells = PART + 100;
        let mut stream = Stream::new(1, 2, 3, 4);
        let rows: Vec<Vec<(u32, f32)>> = (0..2 * cells as u32)
            .map(|row| {
                let first = (row / 2).min(cells as u32 - 4);
                (0..3)
                    .map(|i| (first + i, stream.uniform()))
                    .filter(|(_, weight)| *weight > 0.2)
                    .collect()
            })
            .collect();
        let observations = Observations::new(&rows, cells);
        let mut color = || Vec3::new(stream.uniform(), stream.uniform(), stream.uniform());
        let weights: Vec<Vec3> = rows.iter().map(|_| color()).collect();
        let x: Vec<Vec3> = (0..cells).map(|_| color()).collect();
        let expected = observations.transpose_times(&weights, &observations.values(&x));
        let padded: Vec<Vec3A> = x.iter().map(|&x| x.into()).collect();
        let mut product = Vec::new();
        let matrix = NormalMatrix::new(&observations, &weights);
        matrix.product(&padded, |cell| padded[cell] * 0.5, &mut product);
        for ((product, expected), x) in product.iter().zip(&expected).zip(&x) {
            assert!((Vec3::from(*product) - *expected - *x * 0.5).length() < 1e-5);
        }
    }
}
