//! Colours of cells from noisy measurements: least squares with a total-variation penalty on the graph of neighbours, which
//! smooths but keeps edges (the fused lasso on a graph).
//!
//! Minimises ½ Σ ω ‖y − Σ w x‖² + λ Σ b φ(‖xᵢ − xⱼ‖ / l) + ½ τ Σ ‖x − p‖². The second sum is over pairs of neighbours with common
//! border b and mean level l, where φ is Huber's: quadratic up to [`FLAT`], linear beyond. The norm couples the channels, so that
//! edges coincide in all of them. The third sum is the prior about the mean p. Solved by iteratively reweighted least squares with
//! preconditioned conjugate gradients.

use crate::inverse::texture::links::Links;
use crate::inverse::texture::normal_matrix::NormalMatrix;
use crate::inverse::texture::observations::Observations;
use glam::{Vec3, Vec3A};
use rayon::prelude::*;

/// Relative differences below this are penalised quadratically, as gradients instead of edges.
pub const FLAT: f32 = 0.02;
/// Greatest number of reweighted solves.
const MAX_REWEIGHTINGS: u32 = 5;
/// Greatest number of conjugate gradient iterations in each.
const MAX_STEPS: u32 = 12;
/// Root mean square change of the colours below which the iteration ends.
const CONVERGED: f64 = 1e-3;
/// Terms added up by one thread.
const CHUNK: usize = 4096;
/// Least number of cells or measurements that are given to a thread: fewer cost more than they save.
const TASK: usize = 1024;

/// The measurements and the penalty of a fit.
#[derive(Clone, Copy)]
pub struct Problem<'a> {
    /// The weights w of cells in each measurement.
    pub observations: &'a Observations,
    /// ω of each measurement, per channel.
    pub weights: &'a [Vec3],
    /// y of each measurement.
    pub values: &'a [Vec3],
    /// The graph of neighbours.
    pub links: &'a Links,
    /// The level l of each cell, to which differences are relative.
    pub levels: &'a [f32],
    /// Prior mean of each cell.
    pub prior: &'a [Vec3],
    /// Weight τ of the prior.
    pub prior_weight: f32,
}

/// Finds the colours for the strength λ of the penalty, starting from `start`.
pub fn fuse(problem: &Problem, strength: f32, start: &[Vec3]) -> Vec<Vec3> {
    // On a thread of the pool, where small parallel loops cost nothing.
    rayon::scope(|_| fuse_here(problem, strength, start))
}

fn fuse_here(problem: &Problem, strength: f32, start: &[Vec3]) -> Vec<Vec3> {
    let Problem {
        observations,
        weights: row_weights,
        values,
        links,
        levels,
        prior,
        prior_weight,
    } = *problem;
    let matrix = NormalMatrix::new(observations, row_weights, links);
    let mut right = observations.transpose_times(row_weights, values);
    for (r, mean) in right.iter_mut().zip(prior) {
        *r += *mean * prior_weight;
    }
    let mut colors = start.to_vec();
    for _ in 0..MAX_REWEIGHTINGS {
        let penalties = penalties(links, levels, strength, &colors);
        let system = System::new(&matrix, links, penalties, prior_weight);
        let before = colors.clone();
        system.solve(&right, &mut colors);
        let change: f64 = sum(&colors, &before, |a, b| f64::from((a - b).length_squared()));
        if change <= CONVERGED * CONVERGED * colors.len() as f64 {
            break;
        }
    }
    colors
}

/// λ b / (l max(‖xᵢ − xⱼ‖, FLAT l)) for every link.
pub fn penalties(links: &Links, levels: &[f32], strength: f32, colors: &[Vec3]) -> Vec<f32> {
    let of_cell = |cell: usize| {
        links.neighbours(cell).map(move |(at, other)| {
            let difference = (colors[cell] - colors[other]).length();
            let level = 0.5 * (levels[cell] + levels[other]);
            strength * links.borders[at] / (level * difference.max(FLAT * level))
        })
    };
    let tasks: Vec<Vec<f32>> = (0..colors.len().div_ceil(TASK))
        .into_par_iter()
        .map(|task| {
            let cells = task * TASK..colors.len().min((task + 1) * TASK);
            cells.flat_map(of_cell).collect()
        })
        .collect();
    tasks.concat()
}

/// The normal equations of one reweighting.
pub struct System<'a> {
    /// The measurements' part of the matrix.
    pub matrix: &'a NormalMatrix,
    /// The graph of neighbours.
    pub links: &'a Links,
    /// The weight of each link's squared difference.
    pub penalties: Vec<f32>,
    /// The weight of the prior.
    pub prior_weight: f32,
    /// The diagonal of the whole matrix.
    diagonal: Vec<Vec3A>,
}

impl<'a> System<'a> {
    /// The measurements' part of the matrix, the graph that it was made with, and the weights of the other parts.
    pub fn new(
        matrix: &'a NormalMatrix,
        links: &'a Links,
        penalties: Vec<f32>,
        prior_weight: f32,
    ) -> Self {
        let diagonal = (matrix.diagonal.par_iter().enumerate())
            .with_min_len(TASK)
            .map(|(cell, measured)| {
                let penalty: f32 = penalties[links.row(cell)].iter().sum();
                Vec3A::from(*measured + penalty + prior_weight)
            })
            .collect();
        Self {
            matrix,
            links,
            penalties,
            prior_weight,
            diagonal,
        }
    }

    /// Solves for the right-hand side by conjugate gradients, starting at `colors`.
    pub fn solve(&self, right: &[Vec3], colors: &mut [Vec3]) {
        let scale: Vec<Vec3A> = self.diagonal.iter().map(|d| d.recip()).collect();
        let mut found: Vec<Vec3A> = colors.iter().map(|&c| c.into()).collect();
        let mut product = Vec::new();
        self.apply(&found, &mut product);
        let mut residual: Vec<Vec3A> = (product.iter().zip(right))
            .map(|(p, b)| Vec3A::from(*b) - *p)
            .collect();
        let mut direction: Vec<Vec3A> = (residual.iter().zip(&scale))
            .map(|(r, s)| *r * *s)
            .collect();
        let mut rz = dot(&residual, &direction);
        let goal = rz * 1e-4;
        for _ in 0..MAX_STEPS {
            if !(rz > goal && rz > 0.0) {
                break;
            }
            self.apply(&direction, &mut product);
            let alpha = (rz / dot(&direction, &product)) as f32;
            if !alpha.is_finite() {
                break;
            }
            (found.par_iter_mut().zip(&mut residual))
                .zip(direction.par_iter().zip(&product))
                .with_min_len(TASK)
                .for_each(|((x, r), (d, p))| {
                    *x += *d * alpha;
                    *r -= *p * alpha;
                });
            // With the preconditioner's diagonal.
            let next = sum(&residual, &scale, |r, s| {
                r.as_dvec3().dot((r * s).as_dvec3())
            });
            let beta = (next / rz) as f32;
            (direction.par_iter_mut())
                .zip(residual.par_iter().zip(&scale))
                .with_min_len(TASK)
                .for_each(|(d, (r, s))| *d = *r * *s + *d * beta);
            rz = next;
        }
        for (color, found) in colors.iter_mut().zip(found) {
            *color = found.into();
        }
    }

    /// The product of the matrix and a vector, whose colours are padded so that each is read at once.
    fn apply(&self, x: &[Vec3A], product: &mut Vec<Vec3A>) {
        let Self {
            links,
            penalties,
            diagonal,
            ..
        } = self;
        self.matrix.product(x, links, penalties, diagonal, product);
    }
}

fn dot(a: &[Vec3A], b: &[Vec3A]) -> f64 {
    sum(a, b, |a, b| a.as_dvec3().dot(b.as_dvec3()))
}

/// Sums a function of pairs, in an order that does not depend on the number of threads.
fn sum<T: Copy + Sync>(a: &[T], b: &[T], f: impl Fn(T, T) -> f64 + Sync) -> f64 {
    let parts: Vec<f64> = a
        .par_chunks(CHUNK)
        .zip(b.par_chunks(CHUNK))
        .map(|(a, b)| a.iter().zip(b).map(|(&a, &b)| f(a, b)).sum())
        .collect();
    parts.iter().sum()
}

/// The mean over all channels and entries.
pub fn mean_channel(weights: &[Vec3]) -> f32 {
    let means: Vec<f32> = weights.iter().map(|w| w.element_sum() / 3.0).collect();
    mean(&means)
}

/// The mean, summed in f64.
pub fn mean(values: &[f32]) -> f32 {
    (values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len().max(1) as f64) as f32
}
