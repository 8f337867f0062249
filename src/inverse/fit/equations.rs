//! The normal equations of the fit.
//!
//! With one set of paths for both, noise in the derivative correlates with noise in the residual and an ℓ2 fit is
//! biased towards darkness. Products are therefore taken across the two independent sets A and B.

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

/// Up to so many parameters, matrices over pairs of them are kept.
const MAX_DENSE: usize = 256;

/// Sums over the clusters of the fit for one set of unknowns.
#[derive(Debug, Clone)]
pub struct NormalEquations {
    /// ½ Σ w (J_A r_B + J_B r_A) of each free parameter, the unbiased direction of descent.
    pub descent: Vec<DVec3>,
    /// Diagonal of the Hessian Σ w J̄ J̄ᵀ with J̄ = (J_A + J_B)/2.
    pub diagonal: Vec<DVec3>,
    /// Diagonal of the derivative of minus `descent`, Σ w J_A J_B: without the square of the paths' noise in J̄.
    pub across: Vec<DVec3>,
    /// Diagonal of the scatter Σ g gᵀ of the clusters' contributions g to `descent`.
    pub scatter: Vec<DVec3>,
    /// Σ w r_A r_B, an unbiased measure of the squared error.
    pub objective: DVec3,
    /// Clusters in the sums that say anything.
    pub clusters: usize,
    /// Pixels of those clusters.
    pub pixels: f64,
    /// What is believed besides.
    pub prior: Prior,
    /// How parameters depend on each other.
    pub coupling: Coupling,
}

/// Hessian and scatter.
#[derive(Debug, Clone)]
pub enum Coupling {
    /// As matrices.
    Dense(Matrices),
    /// As the clusters' rows.
    Sparse(Rows),
}

/// Hessian and scatter as matrices, lower triangles.
#[derive(Debug, Clone)]
pub struct Matrices {
    /// Per channel: Σ w J̄ J̄ᵀ; never indefinite.
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

    /// The same with the couplings given.
    pub fn with_coupling(
        linearised: &[Linearised],
        n: usize,
        robust: &RobustWeights,
        prior: &Prior,
        coupling: Coupling,
    ) -> Self {
        let telling = || linearised.iter().filter(|c| !c.bound_met().all());
        let mut sums = Self {
            descent: vec![DVec3::ZERO; n],
            diagonal: vec![DVec3::ZERO; n],
            across: vec![DVec3::ZERO; n],
            scatter: vec![DVec3::ZERO; n],
            objective: DVec3::ZERO,
            clusters: telling().count(),
            pixels: telling().map(|c| c.pixels).sum(),
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

    /// Root of the mean squared residual of a pixel over the level that it is weighed by, over pixels and channels; free of the
    /// paths' noise, which differs between the two sets.
    pub fn relative_residual(&self) -> f64 {
        let mean = self.objective.element_sum() / (3.0 * self.pixels.max(1.0));
        mean.max(0.0).sqrt()
    }
}

impl Matrices {
    /// Of linearised clusters with `n` free parameters.
    pub fn new(linearised: &[Linearised], n: usize, robust: &RobustWeights) -> Self {
        let all = vec![DVec3::ONE; linearised.len()];
        Self::with_residuals_kept(linearised, n, robust, &all)
    }

    /// The same with each cluster's score over the fraction of its residual that it keeps, in the scatter alone.
    pub fn with_residuals_kept(
        linearised: &[Linearised],
        n: usize,
        robust: &RobustWeights,
        kept: &[DVec3],
    ) -> Self {
        let terms: Vec<Vec<Term>> = (linearised.par_iter().zip(kept))
            .map(|(cluster, kept)| Term::of(cluster, robust.weight(cluster), *kept))
            .collect();
        // For each row, the clusters that meet it and the place of its term there.
        let mut where_met: Vec<Vec<(u32, u32)>> = vec![Vec::new(); n];
        for (cluster, terms) in terms.iter().enumerate() {
            for (place, term) in terms.iter().enumerate() {
                where_met[term.place].push((cluster as u32, place as u32));
            }
        }
        // Each row of the lower triangles by itself, its clusters in order.
        let rows: Vec<Vec<[DVec3; 2]>> = (where_met.par_iter().enumerate())
            .map(|(i, met)| {
                let mut row = vec![[DVec3::ZERO; 2]; i + 1];
                for &(cluster, place) in met {
                    let here = &terms[cluster as usize];
                    let own = here[place as usize];
                    for other in here.iter().filter(|other| other.place <= i) {
                        let [h, s] = &mut row[other.place];
                        *h += own.weighted * other.derivative;
                        *s += own.score * other.score;
                    }
                }
                row
            })
            .collect();
        let matrix = |which: usize, channel: usize| {
            DMatrix::from_fn(n, n, |i, j| match rows[i].get(j) {
                Some(both) => both[which][channel],
                None => 0.0,
            })
        };
        Self {
            hessian: std::array::from_fn(|c| matrix(0, c)),
            scatter: std::array::from_fn(|c| matrix(1, c)),
        }
    }
}

/// What one parameter adds to the matrices in one cluster.
#[derive(Debug, Clone, Copy)]
struct Term {
    place: usize,
    /// Sum of the derivatives of both sets.
    derivative: DVec3,
    /// A quarter of the same times the cluster's weight, so that products are those of means.
    weighted: DVec3,
    /// Contribution to the descent, over the fraction of the residual that is kept.
    score: DVec3,
}

impl Term {
    fn of(cluster: &Linearised, weight: DVec3, kept: DVec3) -> Vec<Self> {
        let scores = cluster.scores(weight);
        let terms = cluster.rows.iter().zip(scores);
        terms
            .map(|(&(place, a, b), score)| Self {
                place,
                derivative: a + b,
                weighted: weight * (a + b) * 0.25,
                score: score / kept,
            })
            .collect()
    }
}
