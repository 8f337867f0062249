//! The normal equations of the fit.
//!
//! If derivatives and residuals come from the same paths, their noise is correlated and a least-squares fit is biased towards
//! darkness. Products are therefore taken across the two independent sets A and B.

use crate::inverse::fit::prior::Prior;
use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::fit::rows::Rows;
use crate::inverse::fit::sparse_rows::SparseRows;
use crate::inverse::paths::PathCache;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::roles::places;
use crate::inverse::unknowns::Unknowns;
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
/// Blocks of lines of a matrix that each thread sums. Work is known only roughly, and the rows are read once per block.
const BLOCKS_A_THREAD: usize = 4;

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

/// Hessian and scatter of all pairs of parameters.
#[derive(Debug, Clone)]
pub enum Coupling {
    /// As dense matrices.
    Dense(Matrices),
    /// As the clusters' sparse rows.
    Sparse(Rows),
}

/// The Hessian as dense matrices, and what its scatter is made of.
#[derive(Debug, Clone)]
pub struct Matrices {
    /// Per channel: Σ w J̄ J̄ᵀ, positive semidefinite; only the lower triangle is set.
    pub hessian: [DMatrix<f64>; 3],
    /// Each cluster's contributions to the descent, [`CHUNK`] clusters each.
    scores: Vec<SparseRows>,
}

impl PathCache {
    /// The normal equations for the parameters in `free` (indices into albedos, then emissions).
    pub fn normal_equations(
        &self,
        unknowns: &Unknowns,
        free: &[usize],
        robust: &RobustWeights,
        prior: &Prior,
    ) -> NormalEquations {
        let places = places(free, unknowns.surfaces());
        NormalEquations::new(
            &self.linearise(unknowns, &places, &[]),
            free.len(),
            robust,
            prior,
        )
    }
}

impl NormalEquations {
    /// Sums over linearised clusters with `n` free parameters.
    pub fn new(linearised: &[Linearised], n: usize, robust: &RobustWeights, prior: &Prior) -> Self {
        let coupling = if n <= MAX_DENSE {
            Coupling::Dense(Matrices::new(linearised, n, robust))
        } else {
            Coupling::Sparse(Rows::new(linearised, n, robust))
        };
        Self::with_coupling(linearised, n, robust, prior, coupling)
    }

    /// The same with given off-diagonal terms.
    pub fn with_coupling(
        linearised: &[Linearised],
        n: usize,
        robust: &RobustWeights,
        prior: &Prior,
        coupling: Coupling,
    ) -> Self {
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
            coupling,
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

    /// Mean and precision of the prior of the free parameter in `row`, whose index among all is `parameter`.
    pub fn prior_of(&self, row: usize, parameter: usize) -> (DVec3, DVec3) {
        self.prior.of(parameter, self.prior_variance(row))
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

impl Matrices {
    /// From linearised clusters with `n` free parameters.
    pub fn new(linearised: &[Linearised], n: usize, robust: &RobustWeights) -> Self {
        let rows = |clusters: &[Linearised]| {
            let (mut slopes, mut scores) = (SparseRows::default(), SparseRows::default());
            let mut both: Vec<(u32, DVec3, DVec3)> = Vec::new();
            for cluster in clusters {
                let weight = robust.weight(cluster);
                let root = weight.powf(0.5);
                both.clear();
                both.extend(
                    (cluster.rows.iter().zip(cluster.scores(weight)))
                        .map(|(&(i, a, b), score)| (i as u32, root * (a + b) * 0.5, score)),
                );
                both.sort_unstable_by_key(|entry| entry.0);
                slopes.push(both.iter().map(|&(i, slope, _)| (i, slope)));
                scores.push(both.iter().map(|&(i, _, score)| (i, score)));
            }
            (slopes, scores)
        };
        let (slopes, scores): (Vec<_>, Vec<_>) = linearised.par_chunks(CHUNK).map(rows).unzip();
        Self {
            hessian: gram(&slopes, n),
            scores,
        }
    }

    /// Per channel: Σ g gᵀ over the clusters' contributions g to the descent; only the lower triangle is set.
    pub fn scatter(&self) -> [DMatrix<f64>; 3] {
        gram(&self.scores, self.hessian[0].nrows())
    }

    /// Divides each cluster's contribution to the scatter by its entry of `divisors`.
    pub fn divide_scores(&mut self, divisors: &[DVec3]) {
        let mut divisors = divisors.iter();
        for scores in &mut self.scores {
            scores.divide(&mut divisors);
        }
    }
}

/// Per channel: the lower triangle of Σ v vᵀ over sparse rows v of `n` parameters.
fn gram(rows: &[SparseRows], n: usize) -> [DMatrix<f64>; 3] {
    // Blocks of lines with equal work. Each goes through the rows in their order, so that no sum depends on their number.
    let mut work = vec![0; n];
    for entries in rows.iter().flat_map(SparseRows::iter) {
        for (index, (parameter, _)) in entries.iter().enumerate() {
            work[*parameter as usize] += index + 1;
        }
    }
    let most = work.iter().sum::<usize>() / (BLOCKS_A_THREAD * rayon::current_num_threads()) + 1;
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
            for row in rows.iter().flat_map(SparseRows::iter) {
                let start = row.partition_point(|entry| (entry.0 as usize) < block.start);
                for (index, (i, factor)) in row.iter().enumerate().skip(start) {
                    let i = *i as usize;
                    if i >= block.end {
                        break;
                    }
                    let line = &mut lines[i - block.start];
                    for (j, value) in &row[..=index] {
                        line[*j as usize] += *factor * *value;
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

/// Joins what `of_channel` gives for each of the three channels, which run in parallel. All three have the same length.
pub fn per_channel(of_channel: impl Fn(usize) -> Vec<f64> + Sync) -> Vec<DVec3> {
    let channels: Vec<Vec<f64>> = (0..3).into_par_iter().map(&of_channel).collect();
    let value = |i: usize| DVec3::from_array(std::array::from_fn(|c| channels[c][i]));
    (0..channels[0].len()).map(value).collect()
}
