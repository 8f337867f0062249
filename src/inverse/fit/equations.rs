//! The normal equations of the fit.
//!
//! If derivatives and residuals come from the same paths, their noise is correlated and a least-squares fit is biased towards
//! darkness. Products are therefore taken across the two independent sets A and B.

use crate::inverse::fit::prior::Prior;
use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::fit::rows::Rows;
use crate::inverse::paths::PathCache;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::roles::places;
use crate::inverse::unknowns::Unknowns;
use glam::DVec3;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Greatest number of parameters for which dense matrices are stored.
const MAX_DENSE: usize = 256;

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

/// Hessian and scatter as dense matrices; only the lower triangles are set.
#[derive(Debug, Clone)]
pub struct Matrices {
    /// Per channel: Σ w J̄ J̄ᵀ, positive semidefinite.
    pub hessian: [DMatrix<f64>; 3],
    /// Per channel: Σ g gᵀ, for standard errors.
    pub scatter: [DMatrix<f64>; 3],
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
        let active = || linearised.iter().filter(|c| !c.bound_met().all());
        let mut sums = Self {
            descent: vec![DVec3::ZERO; n],
            diagonal: vec![DVec3::ZERO; n],
            across: vec![DVec3::ZERO; n],
            scatter: vec![DVec3::ZERO; n],
            objective: DVec3::ZERO,
            clusters: active().count(),
            pixels: active().map(|c| c.pixels).sum(),
            prior: prior.clone(),
            coupling,
        };
        for cluster in linearised {
            let weight = robust.weight(cluster);
            sums.objective += weight * cluster.residuals[0] * cluster.residuals[1];
            for (&(i, a, b), score) in cluster.rows.iter().zip(cluster.scores(weight)) {
                let mean = (a + b) * 0.5;
                sums.descent[i] += score;
                sums.diagonal[i] += weight * mean * mean;
                sums.across[i] += weight * a * b;
                sums.scatter[i] += score * score;
            }
        }
        sums
    }

    /// Root mean square of the residuals relative to the pixels' levels, over pixels and channels, without path noise.
    pub fn relative_residual(&self) -> f64 {
        let mean = self.objective.element_sum() / (3.0 * self.pixels.max(1.0));
        mean.max(0.0).sqrt()
    }
}

impl Matrices {
    /// From linearised clusters with `n` free parameters.
    pub fn new(linearised: &[Linearised], n: usize, robust: &RobustWeights) -> Self {
        let all = vec![DVec3::ONE; linearised.len()];
        Self::with_scores_over(linearised, n, robust, &all)
    }

    /// The same with each cluster's score divided by its entry of `divisors` in the scatter.
    pub fn with_scores_over(
        linearised: &[Linearised],
        n: usize,
        robust: &RobustWeights,
        divisors: &[DVec3],
    ) -> Self {
        let terms: Vec<Vec<Term>> = (linearised.par_iter().zip(divisors))
            .map(|(cluster, divisor)| Term::all(cluster, robust.weight(cluster), *divisor))
            .collect();
        // For each parameter, the clusters with a term of it and the index of that term.
        let mut terms_of: Vec<Vec<(u32, u32)>> = vec![Vec::new(); n];
        for (cluster, terms) in terms.iter().enumerate() {
            for (index, term) in terms.iter().enumerate() {
                terms_of[term.parameter].push((cluster as u32, index as u32));
            }
        }
        // Each row of the lower triangles is summed in the order of the clusters.
        let rows: Vec<Vec<[DVec3; 2]>> = (terms_of.par_iter().enumerate())
            .map(|(i, own_terms)| {
                let mut row = vec![[DVec3::ZERO; 2]; i + 1];
                for &(cluster, index) in own_terms {
                    let terms = &terms[cluster as usize];
                    let own = terms[index as usize];
                    for other in terms.iter().filter(|other| other.parameter <= i) {
                        let [h, s] = &mut row[other.parameter];
                        *h += own.weighted * other.derivative;
                        *s += own.score * other.score;
                    }
                }
                row
            })
            .collect();
        let matrix = |which: usize, channel: usize| {
            DMatrix::from_fn(n, n, |i, j| match rows[i].get(j) {
                Some(entry) => entry[which][channel],
                None => 0.0,
            })
        };
        Self {
            hessian: std::array::from_fn(|c| matrix(0, c)),
            scatter: std::array::from_fn(|c| matrix(1, c)),
        }
    }
}

/// A cluster's factors of one parameter in the matrices.
#[derive(Debug, Clone, Copy)]
struct Term {
    parameter: usize,
    /// J_A + J_B.
    derivative: DVec3,
    /// w (J_A + J_B) / 4, so that its product with `derivative` is w J̄ J̄.
    weighted: DVec3,
    /// Contribution to the descent, over the divisor.
    score: DVec3,
}

impl Term {
    fn all(cluster: &Linearised, weight: DVec3, divisor: DVec3) -> Vec<Self> {
        let scores = cluster.scores(weight);
        let terms = cluster.rows.iter().zip(scores);
        terms
            .map(|(&(parameter, a, b), score)| Self {
                parameter,
                derivative: a + b,
                weighted: weight * (a + b) * 0.25,
                score: score / divisor,
            })
            .collect()
    }
}
