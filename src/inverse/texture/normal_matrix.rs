//! The matrix Σ ω w wᵀ of measurements plus the penalties of links, summed once so that each product reads a cell's neighbours and
//! not all its pixels.

use crate::inverse::texture::links::Links;
use crate::inverse::texture::observations::{Observations, row_range};
use glam::{Vec3, Vec3A};
use rayon::prelude::*;

/// Number of cells in a part.
const PART: usize = 4096;
/// Mark of a cell without an entry in the present row.
const NONE: u32 = u32::MAX;

/// The matrix of the measurements, per channel, with room for penalties.
#[derive(Debug, Clone)]
pub struct NormalMatrix {
    /// The diagonal.
    pub diagonal: Vec<Vec3>,
    /// The other entries, [`PART`] cells each.
    parts: Vec<Part>,
}

/// Entries of consecutive cells in compressed sparse rows. A row begins with the cell's links, in their order.
#[derive(Debug, Clone, Default)]
struct Part {
    ends: Vec<u32>,
    cells: Vec<u32>,
    values: Vec<Vec3A>,
}

impl NormalMatrix {
    /// From the weights w of cells in each measurement and the weight ω of each measurement, per channel.
    pub fn new(observations: &Observations, row_weights: &[Vec3], links: &Links) -> Self {
        let count = observations.cells();
        let parts: Vec<Part> = (0..count.div_ceil(PART))
            .into_par_iter()
            .map(|part| {
                let cells = part * PART..count.min((part + 1) * PART);
                Part::new(observations, row_weights, links, cells)
            })
            .collect();
        Self {
            diagonal: observations.diagonal(row_weights),
            parts,
        }
    }

    /// The product of `x` and the matrix with a penalty for each link's squared difference, in `result`. `diagonal` is that of the
    /// whole.
    pub fn product(
        &self,
        x: &[Vec3A],
        links: &Links,
        penalties: &[f32],
        diagonal: &[Vec3A],
        result: &mut Vec<Vec3A>,
    ) {
        result.resize(x.len(), Vec3A::ZERO);
        (result.par_chunks_mut(PART).zip(&self.parts).enumerate()).for_each(
            |(index, (result, part))| {
                for (row, result) in result.iter_mut().enumerate() {
                    let cell = index * PART + row;
                    let entries = row_range(&part.ends, row);
                    let penalties = &penalties[links.row(cell)];
                    let (cells, values) = (&part.cells[entries.clone()], &part.values[entries]);
                    let (linked, others) = cells.split_at(penalties.len());
                    let (linked_values, other_values) = values.split_at(penalties.len());
                    let linked = linked.iter().zip(linked_values).zip(penalties);
                    let linked: Vec3A = linked
                        .map(|((&other, value), penalty)| x[other as usize] * (*value - *penalty))
                        .sum();
                    let others: Vec3A = (others.iter().zip(other_values))
                        .map(|(&other, value)| x[other as usize] * *value)
                        .sum();
                    *result = linked + others + x[cell] * diagonal[cell];
                }
            },
        );
    }
}

impl Part {
    fn new(
        observations: &Observations,
        row_weights: &[Vec3],
        links: &Links,
        cells: std::ops::Range<usize>,
    ) -> Self {
        let mut part = Self::default();
        // Where the entry of each other cell is in the present row.
        let mut slots = vec![NONE; observations.cells()];
        for cell in cells {
            let start = part.cells.len();
            for (_, other) in links.neighbours(cell) {
                part.slot(&mut slots, other);
            }
            for (row, weight) in observations.column(cell) {
                let weighted = Vec3A::from(row_weights[row]) * weight;
                for (other, weight) in observations.row(row).filter(|&(other, _)| other != cell) {
                    let slot = part.slot(&mut slots, other);
                    part.values[slot] += weighted * weight;
                }
            }
            for &other in &part.cells[start..] {
                slots[other as usize] = NONE;
            }
            part.ends.push(part.cells.len() as u32);
        }
        part
    }

    /// The entry of another cell in the present row, made where there is none.
    fn slot(&mut self, slots: &mut [u32], other: usize) -> usize {
        if slots[other] == NONE {
            slots[other] = self.cells.len() as u32;
            self.cells.push(other as u32);
            self.values.push(Vec3A::ZERO);
        }
        slots[other] as usize
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
        // Each cell is linked with the next; some of these see pixels together and some do not.
        let pairs: Vec<(u32, u32)> = (0..cells as u32)
            .flat_map(|cell| [cell.wrapping_sub(1), cell + 1].map(|other| (cell, other)))
            .filter(|&(_, other)| (other as usize) < cells)
            .collect();
        let links = Links {
            ends: (1..=cells as u32)
                .map(|cell| (2 * cell - 1).min(pairs.len() as u32))
                .collect(),
            to: pairs.iter().map(|pair| pair.1).collect(),
            borders: vec![1.0; pairs.len()],
        };
        // The penalty of a pair is the same from both sides.
        let penalty = |&(a, b): &(u32, u32)| 0.3 + 0.1 * (a.min(b) % 7) as f32;
        let penalties: Vec<f32> = pairs.iter().map(penalty).collect();
        let mut expected = observations.transpose_times(&weights, &observations.values(&x));
        for (&(cell, other), penalty) in pairs.iter().zip(&penalties) {
            expected[cell as usize] += (x[cell as usize] - x[other as usize]) * *penalty;
        }
        let matrix = NormalMatrix::new(&observations, &weights, &links);
        let diagonal: Vec<Vec3A> = (matrix.diagonal.iter().enumerate())
            .map(|(cell, d)| Vec3A::from(*d) + penalties[links.row(cell)].iter().sum::<f32>())
            .collect();
        let padded: Vec<Vec3A> = x.iter().map(|&x| x.into()).collect();
        let mut product = Vec::new();
        matrix.product(&padded, &links, &penalties, &diagonal, &mut product);
        for (product, expected) in product.iter().zip(&expected) {
            assert!((Vec3::from(*product) - *expected).length() < 1e-5);
        }
    }
}
