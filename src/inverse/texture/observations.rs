//! Measurements as weighted means over cells, in sparse rows and columns, with the products of the normal equations.

use glam::Vec3;
use rayon::prelude::*;
use std::ops::Range;

/// The indices of a row in compressed sparse rows, given the end of each row.
#[inline]
pub fn row_range(ends: &[u32], row: usize) -> Range<usize> {
    let start = if row == 0 { 0 } else { ends[row - 1] };
    start as usize..ends[row] as usize
}

/// Measurements y ≈ Σ w x of the colours x of cells, one row each; the weights of a row sum to one.
#[derive(Debug, Clone, Default)]
pub struct Observations {
    /// End of each row.
    ends: Vec<u32>,
    cells: Vec<u32>,
    weights: Vec<f32>,
    /// End of each cell's column.
    column_ends: Vec<u32>,
    column_rows: Vec<u32>,
    column_weights: Vec<f32>,
}

impl Observations {
    /// From rows of (cell, weight).
    pub fn new(rows: &[Vec<(u32, f32)>], cell_count: usize) -> Self {
        let mut this = Self::default();
        let mut counts = vec![0u32; cell_count];
        for row in rows {
            for &(cell, weight) in row {
                this.cells.push(cell);
                this.weights.push(weight);
                counts[cell as usize] += 1;
            }
            this.ends.push(this.cells.len() as u32);
        }
        let mut next = Vec::with_capacity(cell_count);
        let mut sum = 0;
        for count in counts {
            next.push(sum);
            sum += count;
            this.column_ends.push(sum);
        }
        this.column_rows = vec![0; sum as usize];
        this.column_weights = vec![0.0; sum as usize];
        for (index, row) in rows.iter().enumerate() {
            for &(cell, weight) in row {
                let at = &mut next[cell as usize];
                this.column_rows[*at as usize] = index as u32;
                this.column_weights[*at as usize] = weight;
                *at += 1;
            }
        }
        this
    }

    /// One measurement of each cell.
    pub fn one_per_cell(cell_count: usize) -> Self {
        let rows: Vec<Vec<(u32, f32)>> = (0..cell_count as u32).map(|c| vec![(c, 1.0)]).collect();
        Self::new(&rows, cell_count)
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.ends.len()
    }

    /// Number of cells.
    pub fn cells(&self) -> usize {
        self.column_ends.len()
    }

    /// Number of rows that see a cell.
    pub fn seen(&self, cell: usize) -> u32 {
        row_range(&self.column_ends, cell).len() as u32
    }

    /// The cells and weights of a row.
    #[inline]
    pub fn row(&self, row: usize) -> impl Iterator<Item = (usize, f32)> + '_ {
        row_range(&self.ends, row).map(|at| (self.cells[at] as usize, self.weights[at]))
    }

    /// The rows and weights of a cell.
    #[inline]
    pub fn column(&self, cell: usize) -> impl Iterator<Item = (usize, f32)> + '_ {
        row_range(&self.column_ends, cell)
            .map(|at| (self.column_rows[at] as usize, self.column_weights[at]))
    }

    /// The value Σ w x of a row for the given colours.
    #[inline]
    pub fn value(&self, row: usize, colors: &[Vec3]) -> Vec3 {
        self.row(row).map(|(cell, w)| colors[cell] * w).sum()
    }

    /// The values of all rows.
    pub fn values(&self, colors: &[Vec3]) -> Vec<Vec3> {
        (0..self.rows())
            .into_par_iter()
            .map(|row| self.value(row, colors))
            .collect()
    }

    /// For each cell, Σ w ω y over its rows, with the weights ω (per channel) and values y of rows.
    pub fn transpose_times(&self, row_weights: &[Vec3], values: &[Vec3]) -> Vec<Vec3> {
        (0..self.cells())
            .into_par_iter()
            .map(|cell| {
                self.column(cell)
                    .map(|(row, w)| values[row] * row_weights[row] * w)
                    .sum()
            })
            .collect()
    }

    /// For each cell, Σ w² ω over its rows: the diagonal of the normal equations.
    pub fn diagonal(&self, row_weights: &[Vec3]) -> Vec<Vec3> {
        (0..self.cells())
            .into_par_iter()
            .map(|cell| {
                self.column(cell)
                    .map(|(row, w)| row_weights[row] * (w * w))
                    .sum()
            })
            .collect()
    }
}
