//! One sparse row of three channels for each cluster, one after another in memory: its derivatives or its scores.

use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::paths::evaluate::Linearised;
use glam::{DVec3, Vec3};
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Number of partial sums over clusters; fixed, for the same bits on any number of threads.
const PARTS: usize = 8;
/// Blocks of lines of a matrix that each thread sums. Work is known only roughly, and the rows are read once per block.
const BLOCKS_A_THREAD: usize = 4;

/// A non-zero entry; in f32, since memory bandwidth is the bottleneck.
#[derive(Debug, Clone, Copy)]
pub struct Entry {
    parameter: u32,
    value: Vec3,
}

/// The rows r of all clusters, by increasing parameter.
#[derive(Debug, Clone)]
pub struct SparseRows {
    /// Number of parameters.
    columns: usize,
    /// End of each row.
    ends: Vec<usize>,
    entries: Vec<Entry>,
}

impl SparseRows {
    /// √w J̄ of each cluster over `columns` free parameters, with J̄ the mean derivative of both sets: Σ r rᵀ is the Hessian.
    pub fn slopes(clusters: &[Linearised], columns: usize, robust: &RobustWeights) -> Self {
        Self::new(clusters, columns, |_, cluster, row| {
            let root = robust.weight(cluster).powf(0.5);
            row.extend((cluster.rows.iter()).map(|&(i, a, b)| entry(i, root * (a + b) * 0.5)));
        })
    }

    /// Each cluster's contribution to the descent, over one minus its leverage in `kept`: Σ r rᵀ is the scatter.
    pub fn scores(
        clusters: &[Linearised],
        columns: usize,
        robust: &RobustWeights,
        kept: impl Fn(usize) -> DVec3 + Sync,
    ) -> Self {
        Self::new(clusters, columns, |index, cluster, row| {
            let kept = kept(index);
            let scores = cluster.scores(robust.weight(cluster));
            row.extend(
                (cluster.rows.iter().zip(scores)).map(|(r, score)| entry(r.0, score / kept)),
            );
        })
    }

    /// One row for each cluster, which `append` adds the entries of.
    fn new(
        clusters: &[Linearised],
        columns: usize,
        append: impl Fn(usize, &Linearised, &mut Vec<Entry>) + Sync,
    ) -> Self {
        let chunk = clusters.len().div_ceil(PARTS).max(1);
        let parts: Vec<(Vec<usize>, Vec<Entry>)> = (clusters.par_chunks(chunk).enumerate())
            .map(|(part, clusters)| {
                let (mut ends, mut entries) = (Vec::with_capacity(clusters.len()), Vec::new());
                for (index, cluster) in clusters.iter().enumerate() {
                    debug_assert!(cluster.rows.is_sorted_by_key(|row| row.0));
                    append(part * chunk + index, cluster, &mut entries);
                    ends.push(entries.len());
                }
                (ends, entries)
            })
            .collect();
        let (mut ends, mut entries) = (Vec::with_capacity(clusters.len()), Vec::new());
        for (part_ends, part) in parts {
            let before = entries.len();
            ends.extend(part_ends.iter().map(|end| before + end));
            entries.extend(part);
        }
        Self {
            columns,
            ends,
            entries,
        }
    }

    fn row(&self, index: usize) -> &[Entry] {
        let start = index.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.entries[start..self.ends[index]]
    }

    fn rows(&self) -> impl Iterator<Item = &[Entry]> {
        (0..self.ends.len()).map(|index| self.row(index))
    }

    /// Σ f r with a factor f of each row, from its index and entries.
    fn sum(&self, factor: impl Fn(usize, &[Entry]) -> DVec3 + Sync) -> Vec<DVec3> {
        let count = self.ends.len();
        let parts: Vec<Vec<DVec3>> = (0..PARTS)
            .into_par_iter()
            .map(|part| {
                let mut sum = vec![DVec3::ZERO; self.columns];
                for index in part * count / PARTS..(part + 1) * count / PARTS {
                    let row = self.row(index);
                    let factor = factor(index, row);
                    for entry in row {
                        sum[entry.parameter as usize] += entry.value.as_dvec3() * factor;
                    }
                }
                sum
            })
            .collect();
        let mut total = vec![DVec3::ZERO; self.columns];
        for part in parts {
            for (sum, more) in total.iter_mut().zip(part) {
                *sum += more;
            }
        }
        total
    }

    /// Σ f r with a factor f of each row, from its index.
    pub fn weighted(&self, factor: impl Fn(usize) -> DVec3 + Sync) -> Vec<DVec3> {
        self.sum(|index, _| factor(index))
    }

    /// (Σ r rᵀ) v.
    pub fn gram_times(&self, v: &[DVec3]) -> Vec<DVec3> {
        self.sum(|_, row| dot(row, v))
    }

    /// vᵀ (Σ r rᵀ) v.
    pub fn gram_along(&self, v: &[DVec3]) -> DVec3 {
        let squares = self
            .rows()
            .map(|row| dot(row, v))
            .map(|along| along * along);
        squares.sum()
    }

    /// Per channel: the lower triangle of Σ r rᵀ.
    pub fn gram(&self) -> [DMatrix<f64>; 3] {
        // Blocks of lines with equal work. Each goes through the rows in their order, so that no sum depends on their number.
        let n = self.columns;
        let mut work = vec![0; n];
        for row in self.rows() {
            for (index, entry) in row.iter().enumerate() {
                work[entry.parameter as usize] += index + 1;
            }
        }
        let most =
            work.iter().sum::<usize>() / (BLOCKS_A_THREAD * rayon::current_num_threads()) + 1;
        let (mut starts, mut done) = (vec![0], 0);
        for (parameter, work) in work.iter().enumerate() {
            done += work;
            if done >= most * starts.len() {
                starts.push(parameter + 1);
            }
        }
        starts.push(n);
        let lines: Vec<Vec<Vec<DVec3>>> = (starts.par_windows(2))
            .map(|ends| {
                let block = ends[0]..ends[1];
                let mut lines: Vec<_> = block.clone().map(|i| vec![DVec3::ZERO; i + 1]).collect();
                for row in self.rows() {
                    let start = row.partition_point(|e| (e.parameter as usize) < block.start);
                    for (index, entry) in row.iter().enumerate().skip(start) {
                        let i = entry.parameter as usize;
                        if i >= block.end {
                            break;
                        }
                        let (line, factor) = (&mut lines[i - block.start], entry.value.as_dvec3());
                        for other in &row[..=index] {
                            line[other.parameter as usize] += factor * other.value.as_dvec3();
                        }
                    }
                }
                lines
            })
            .collect();
        let lines: Vec<&Vec<DVec3>> = lines.iter().flatten().collect();
        std::array::from_fn(|channel| {
            DMatrix::from_fn(n, n, |i, j| lines[i].get(j).map_or(0.0, |v| v[channel]))
        })
    }
}

fn entry(parameter: usize, value: DVec3) -> Entry {
    Entry {
        parameter: parameter as u32,
        value: value.as_vec3(),
    }
}

/// Dot product of a row with a vector.
fn dot(row: &[Entry], v: &[DVec3]) -> DVec3 {
    (row.iter())
        .map(|e| e.value.as_dvec3() * v[e.parameter as usize])
        .sum()
}
