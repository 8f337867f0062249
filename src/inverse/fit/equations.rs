//! The normal equations of the fit.
//!
//! If derivatives and residuals come from the same paths, their noise is correlated and a least-squares fit is biased towards
//! darkness. Products are therefore taken across the two independent sets A and B.

use crate::inverse::fit::prior::Prior;
use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::fit::sparse_rows::SparseRows;
use crate::inverse::paths::evaluate::Linearised;
use glam::DVec3;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Greatest number of parameters for which dense matrices are stored, 8 MB a channel. `relit trade --rooms 3 --family clutter
/// --preset preview` takes 3.1 s a room in the median, and 4.0 s with a limit of 256. More was not tried.
const MAX_DENSE: usize = 1024;

/// Least fraction of a curvature that is taken to be signal.
pub const MIN_SIGNAL: f64 = 0.05;
/// Clusters that are summed by one thread, in their order.
const CHUNK: usize = 2048;

/// Sums over the clusters of the fit at one value of the unknowns. Vectors have one entry per free parameter.
#[derive(Debug, Clone)]
pub struct NormalEquations {
    /// ½ Σ w (J_A r_B + J_B r_A), the unbiased direction of descent.
    pub descent: Vec<DVec3>,
    /// Diagonal of the Hessian Σ w J̄ J̄ᵀ with J̄ = (J_A + J_B)/2.
    pub diagonal: Vec<DVec3>,
    /// Σ w J_A J_B, the diagonal of the derivative of −`descent`. Unlike `diagonal` it lacks the squared path noise of J̄.
    pub across: Vec<DVec3>,
    /// Diagonal of the scatter Σ g gᵀ of the clusters' contributions g to `descent`.
    pub scatter: Vec<DVec3>,
    /// The part of `scatter` that is path noise: Σ h hᵀ with half the difference h of what both sets contribute.
    pub path_scatter: Vec<DVec3>,
    /// Σ w r_A r_B, an unbiased estimate of the squared error.
    pub objective: DVec3,
    /// Number of clusters with a residual in any channel.
    pub clusters: usize,
    /// Number of pixels in those clusters.
    pub pixels: f64,
    /// The prior of the unknowns.
    pub prior: Prior,
    /// The off-diagonal terms.
    pub coupling: Coupling,
}

/// The Hessian Σ w J̄ J̄ᵀ of all pairs of parameters.
#[derive(Debug, Clone)]
pub enum Coupling {
    /// As a matrix per channel, positive semidefinite; only the lower triangle is set.
    Dense([DMatrix<f64>; 3]),
    /// As the clusters' rows √w J̄.
    Sparse(SparseRows),
}

impl NormalEquations {
    /// Sums over linearised clusters with `n` free parameters.
    pub fn new(linearised: &[Linearised], n: usize, robust: &RobustWeights, prior: &Prior) -> Self {
        Self::with_at_most(MAX_DENSE, linearised, n, robust, prior)
    }

    /// The same with matrices of at most `max_dense` parameters.
    pub fn with_at_most(
        max_dense: usize,
        linearised: &[Linearised],
        n: usize,
        robust: &RobustWeights,
        prior: &Prior,
    ) -> Self {
        let slopes = SparseRows::slopes(linearised, n, robust);
        let chunks: Vec<Sums> = (linearised.par_chunks(CHUNK))
            .map(|chunk| Sums::new(chunk, n, robust))
            .collect();
        let mut total = Sums::new(&[], n, robust);
        chunks.iter().for_each(|chunk| total.add(chunk));
        let [descent, diagonal, across, scatter, path_scatter] =
            [0, 1, 2, 3, 4].map(|sum| total.parameters.iter().map(|sums| sums[sum]).collect());
        Self {
            descent,
            diagonal,
            across,
            scatter,
            path_scatter,
            objective: total.objective,
            clusters: total.clusters,
            pixels: total.pixels,
            prior: prior.clone(),
            coupling: if n <= max_dense {
                Coupling::Dense(slopes.gram())
            } else {
                Coupling::Sparse(slopes)
            },
        }
    }

    /// A parameter's curvature without the noise of its derivatives.
    pub fn signal(&self, row: usize) -> DVec3 {
        self.across[row].max(self.diagonal[row] * MIN_SIGNAL)
    }

    /// Variance of a cluster's residual by which the prior of the free parameter in `row` is weighed: the mean without path noise,
    /// and the path noise of the parameter's own scores over its curvature. The variance of scores over the curvature is what makes
    /// the mean squared error of a shrunken estimate least. Parameters that few paths meet stay nearer to their prior.
    pub fn prior_variance(&self, row: usize) -> DVec3 {
        let mean = (self.objective / self.clusters.max(1) as f64).max(DVec3::splat(1e-12));
        let met = self.diagonal[row].cmpgt(DVec3::ZERO);
        mean + DVec3::select(met, self.path_scatter[row] / self.signal(row), DVec3::ZERO)
    }

    /// Root mean square of the residuals relative to the pixels' levels, over pixels and channels, without path noise.
    pub fn relative_residual(&self) -> f64 {
        let mean = self.objective.element_sum() / (3.0 * self.pixels.max(1.0));
        mean.max(0.0).sqrt()
    }
}

/// Sums over some of the clusters.
struct Sums {
    /// Of each parameter: descent, diagonal, across, scatter and path scatter of [`NormalEquations`].
    parameters: Vec<[DVec3; 5]>,
    objective: DVec3,
    clusters: usize,
    pixels: f64,
}

impl Sums {
    fn new(clusters: &[Linearised], n: usize, robust: &RobustWeights) -> Self {
        let active = || clusters.iter().filter(|c| !c.bound_met().all());
        let mut sums = Self {
            parameters: vec![[DVec3::ZERO; 5]; n],
            objective: DVec3::ZERO,
            clusters: active().count(),
            pixels: active().map(|c| c.pixels).sum(),
        };
        for cluster in clusters {
            let weight = robust.weight(cluster);
            sums.objective += weight * cluster.residuals[0] * cluster.residuals[1];
            for (&(i, a, b), [of_a, of_b]) in cluster.rows.iter().zip(cluster.set_scores(weight)) {
                let mean = (a + b) * 0.5;
                let [score, noise] = [(of_a + of_b) * 0.5, (of_a - of_b) * 0.5];
                let [descent, diagonal, across, scatter, path_scatter] = &mut sums.parameters[i];
                *descent += score;
                *diagonal += weight * mean * mean;
                *across += weight * a * b;
                *scatter += score * score;
                *path_scatter += noise * noise;
            }
        }
        sums
    }

    fn add(&mut self, other: &Self) {
        for (sums, others) in self.parameters.iter_mut().zip(&other.parameters) {
            for (sum, other) in sums.iter_mut().zip(others) {
                *sum += *other;
            }
        }
        self.objective += other.objective;
        self.clusters += other.clusters;
        self.pixels += other.pixels;
    }
}

/// Joins what `of_channel` gives for each of the three channels, which run in parallel. All three have the same length.
pub fn per_channel(of_channel: impl Fn(usize) -> Vec<f64> + Sync) -> Vec<DVec3> {
    let channels: Vec<Vec<f64>> = (0..3).into_par_iter().map(&of_channel).collect();
    let value = |i: usize| DVec3::from_array(std::array::from_fn(|c| channels[c][i]));
    (0..channels[0].len()).map(value).collect()
}
