//! Standard errors of fitted parameters, and score tests of parameters held fixed.

use crate::inverse::fit::equations::{Coupling, NormalEquations, per_channel};
use crate::inverse::fit::prior::ALBEDO_DEVIATION;
use crate::inverse::fit::prior_terms::PriorTerms;
use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::fit::sparse_rows::SparseRows;
use crate::inverse::fit::sparse_step::SparseHessian;
use crate::inverse::paths::evaluate::Linearised;
use crate::math::cholesky;
use crate::math::rng::Stream;
use glam::{DVec3, Vec3};
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Bootstrap draws for standard errors without dense matrices: standard errors are then accurate to 10 %.
const DRAWS: u64 = 48;
/// Relative residual of a draw's solution.
const DRAW_TOLERANCE: f64 = 1e-2;
const KEY: u64 = 0x6d75_6c74;
/// Number of parameters that are tested exactly without dense matrices.
const MAX_EXACT: usize = 24;
/// Least value of one minus a cluster's leverage.
const MIN_KEPT: f64 = 0.1;
/// Least fraction of its curvature that a parameter keeps when the active ones are eliminated. Below, it is degenerate.
const MIN_OWN: f64 = 1e-9;

/// Standard errors of all parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct StandardErrors {
    /// Of each object's albedo; the prior's standard deviation if it was not fitted.
    pub albedo: Vec<Vec3>,
    /// Of each object's emission; infinite if it was not fitted.
    pub emission: Vec<Vec3>,
}

/// Score test of a parameter that is held fixed: the step it would take if it were set free.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScoreTest {
    /// Index into albedos, then emissions.
    pub index: usize,
    /// The step, per channel.
    pub step: DVec3,
    /// Standard error of the step, per channel.
    pub stderr: DVec3,
    /// Half the second derivative of the squared error with the active parameters eliminated, per channel.
    pub curvature: DVec3,
}

impl ScoreTest {
    /// χ² with three degrees of freedom, over the channels that would increase.
    pub fn significance(&self) -> f64 {
        let counted = self.step.cmpgt(DVec3::ZERO) & self.stderr.cmpgt(DVec3::ZERO);
        DVec3::select(counted, self.step / self.stderr, DVec3::ZERO).length_squared()
    }

    /// Decrease of the squared error, over the channels that would increase.
    pub fn gain(&self) -> f64 {
        let step = self.step.max(DVec3::ZERO);
        (step * step * self.curvature).element_sum()
    }
}

/// Standard errors of the parameters in `free`: the sandwich estimator (H + P)⁻¹ (S + vP) (H + P)⁻¹ with the prior's precision P
/// and the scatter S of the clusters' scores. It includes the noise of photographs and of paths for any distribution (Huber 1967).
///
/// H contains the squared noise of the derivatives, which the descent does not. It would make parameters that few paths meet
/// seem too certain, so errors are multiplied by the ratio of both curvatures, up to the prior's standard deviation.
///
/// `scores` are the clusters' [`SparseRows::scores`], or those of [`leave_one_out`].
pub fn standard_errors(
    equations: &NormalEquations,
    prior: &PriorTerms,
    scores: &SparseRows,
    free: &[usize],
    objects: usize,
) -> StandardErrors {
    let variances = match &equations.coupling {
        Coupling::Dense(hessian) => sandwich(hessian, &scores.gram(), prior),
        Coupling::Sparse(slopes) => {
            let hessian = SparseHessian {
                slopes,
                diagonal: &equations.diagonal,
                prior,
            };
            bootstrap(hessian, scores)
        }
    };
    let mut errors = StandardErrors {
        albedo: vec![Vec3::splat(ALBEDO_DEVIATION); objects],
        emission: vec![Vec3::INFINITY; objects],
    };
    for (row, (&index, variance)) in free.iter().zip(variances).enumerate() {
        let diagonal = equations.diagonal[row];
        let inflation = (diagonal / equations.signal(row)).max(DVec3::ONE);
        let own = variance.max(DVec3::ZERO).powf(0.5);
        let error = (own * inflation)
            .min(prior.deviation[row])
            .max(own)
            .as_vec3();
        let target = match index.checked_sub(objects) {
            None => &mut errors.albedo[index],
            Some(emitter) => &mut errors.emission[emitter],
        };
        let known = diagonal.cmpgt(DVec3::ZERO) & variance.cmpge(DVec3::ZERO);
        *target = Vec3::select(known, error, *target);
    }
    errors
}

/// The scores of clusters, each over one minus the cluster's leverage (HC3, MacKinnon and White 1985). Few clusters determine a lamp
/// or a small object, and the fit passes through them as if they had no noise. Only with dense matrices are scores corrected; with
/// sparse rows, errors of parameters that few clusters determine are too small.
pub fn leave_one_out(
    equations: &NormalEquations,
    prior: &PriorTerms,
    clusters: &[Linearised],
    robust: &RobustWeights,
) -> SparseRows {
    let n = equations.diagonal.len();
    let Coupling::Dense(hessian) = &equations.coupling else {
        return SparseRows::scores(clusters, n, robust, |_| DVec3::ONE);
    };
    let inverses: Vec<Option<DMatrix<f64>>> = (0..3)
        .into_par_iter()
        .map(|c| inverse(&hessian[c], prior, c))
        .collect();
    SparseRows::scores(clusters, n, robust, |index| {
        let cluster = &clusters[index];
        let weight = robust.weight(cluster);
        DVec3::from_array(std::array::from_fn(|c| {
            let leverage = (inverses[c].as_ref()).map_or(0.0, |m| quadratic(m, cluster, c));
            (1.0 - weight[c] * leverage).max(MIN_KEPT)
        }))
    })
}

/// J̄ᵀ M J̄ of a cluster's derivatives in one channel.
fn quadratic(matrix: &DMatrix<f64>, cluster: &Linearised, channel: usize) -> f64 {
    let slope = |&(row, a, b): &(usize, DVec3, DVec3)| (row, 0.5 * (a[channel] + b[channel]));
    let mut sum = 0.0;
    for (i, left) in cluster.rows.iter().map(slope) {
        let column = matrix.column(i);
        let right = cluster.rows.iter().map(slope);
        let product: f64 = right.map(|(j, right)| column[j] * right).sum();
        sum += left * product;
    }
    sum
}

/// Inverse of one channel's Hessian plus the prior, over the prior's parameters, which are the first ones; damped as far as needed
/// to be positive definite, `None` if that fails.
fn inverse(hessian: &DMatrix<f64>, prior: &PriorTerms, channel: usize) -> Option<DMatrix<f64>> {
    let n = prior.added.len();
    let hessian = prior.couple(hessian, channel);
    let mut damping = 0.0;
    while damping < 1e6 {
        let matrix = DMatrix::from_fn(n, n, |a, b| {
            let h = hessian[(a.max(b), a.min(b))];
            h + if a == b {
                prior.added[a][channel] + damping * h
            } else {
                0.0
            }
        });
        if let Some(factored) = cholesky::factor(matrix) {
            return Some(cholesky::inverse(&factored));
        }
        damping = (damping * 10.0).max(1e-9);
    }
    None
}

/// Variances from dense matrices; −1 in channels without an inverse.
fn sandwich(
    hessian: &[DMatrix<f64>; 3],
    scatter: &[DMatrix<f64>; 3],
    prior: &PriorTerms,
) -> Vec<DVec3> {
    let n = prior.added.len();
    per_channel(|channel| {
        let Some(bread) = inverse(&hessian[channel], prior, channel) else {
            return vec![-1.0; n];
        };
        let scatter = &scatter[channel];
        let mut meat = DMatrix::from_fn(n, n, |a, b| {
            let own = (prior.variance[a] * prior.precision[a])[channel];
            scatter[(a.max(b), a.min(b))] + if a == b { own } else { 0.0 }
        });
        for (a, b, coupling) in prior.couplings(channel) {
            let own = coupling * (prior.variance[a] * prior.variance[b])[channel].sqrt();
            meat[(a, b)] += own;
            meat[(b, a)] += own;
        }
        // The diagonal of the product of all three; both matrices are symmetric.
        let product = meat * &bread;
        (0..n)
            .map(|a| product.column(a).dot(&bread.column(a)))
            .collect()
    })
}

/// The same variances by the multiplier bootstrap (Wu 1986): with random signs ε of the clusters, (H + P)⁻¹ Σ ε g has the
/// covariance of the estimate.
fn bootstrap(hessian: SparseHessian, scores: &SparseRows) -> Vec<DVec3> {
    let prior = hessian.prior;
    let n = prior.added.len();
    let roots = prior.roots();
    let (free, zero) = (vec![DVec3::ONE; n], vec![DVec3::ZERO; n]);
    let draws: Vec<Vec<DVec3>> = (0..DRAWS)
        .into_par_iter()
        .map(|draw| {
            let sign = |kind: u64, index: usize| {
                let bit = Stream::new(draw, kind, index as u64, KEY).below(2);
                DVec3::splat([-1.0, 1.0][bit])
            };
            let mut right = scores.weighted(|cluster| sign(0, cluster));
            let signs: Vec<DVec3> = (0..n).map(|i| sign(1, i)).collect();
            for (b, own) in right.iter_mut().zip(prior.scores(&roots, &signs)) {
                *b += own;
            }
            hessian.solve(&prior.added, &free, &right, &zero, DRAW_TOLERANCE)
        })
        .collect();
    (0..n)
        .map(|i| draws.iter().map(|z| z[i] * z[i]).sum::<DVec3>() / DRAWS as f64)
        .collect()
}

/// Score tests (Rao 1948) of the parameters in `free` after the active ones, which come first and have the terms `prior`: for each,
/// the step that it would take if it were set free together with the active ones, and the standard error of the step. `scores` are
/// [`SparseRows::scores`].
pub fn score_tests(
    equations: &NormalEquations,
    prior: &PriorTerms,
    scores: &SparseRows,
    free: &[usize],
) -> Vec<ScoreTest> {
    let active = prior.added.len();
    let eliminated = match &equations.coupling {
        Coupling::Dense(hessian) => {
            eliminate_dense(equations, hessian, &scores.gram(), prior, active)
        }
        Coupling::Sparse(slopes) => eliminate_sparse(equations, slopes, scores, prior, active),
    };
    (eliminated.into_iter().zip(active..))
        .map(|((curvature, variance), row)| {
            let zero = DVec3::ZERO;
            let known = curvature.cmpgt(equations.diagonal[row] * MIN_OWN) & curvature.cmpgt(zero);
            let stderr = variance.max(zero).sqrt() / curvature;
            ScoreTest {
                index: free[row],
                step: DVec3::select(known, equations.descent[row] / curvature, zero),
                stderr: DVec3::select(known, stderr, DVec3::INFINITY),
                curvature: DVec3::select(known, curvature, zero),
            }
        })
        .collect()
}

/// The curvature (Schur complement) and the variance of the score of a tested parameter with the active ones eliminated.
type Eliminated = (DVec3, DVec3);

fn eliminate_dense(
    equations: &NormalEquations,
    hessian: &[DMatrix<f64>; 3],
    scatter: &[DMatrix<f64>; 3],
    prior: &PriorTerms,
    active: usize,
) -> Vec<Eliminated> {
    let tested = equations.diagonal.len() - active;
    // The curvatures of all tested parameters, then their variances.
    let values = per_channel(|channel| {
        let (hessian, scatter) = (&hessian[channel], &scatter[channel]);
        let Some(inverse) = inverse(hessian, prior, channel) else {
            return vec![0.0; 2 * tested];
        };
        let active_scatter = DMatrix::from_fn(active, active, |a, b| scatter[(a.max(b), a.min(b))]);
        // The columns of the tested parameters, over the active ones.
        let coupling = DMatrix::from_fn(active, tested, |a, t| hessian[(active + t, a)]);
        let u = inverse * &coupling;
        let spread = active_scatter * &u;
        let curvature = |t: usize| {
            let row = active + t;
            hessian[(row, row)] - coupling.column(t).dot(&u.column(t))
        };
        let variance = |t: usize| {
            let (row, u) = (active + t, u.column(t));
            let shared: f64 = (0..active).map(|a| u[a] * scatter[(row, a)]).sum();
            scatter[(row, row)] - 2.0 * shared + u.dot(&spread.column(t))
        };
        let curvatures = (0..tested).map(curvature);
        curvatures.chain((0..tested).map(variance)).collect()
    });
    let (curvatures, variances) = values.split_at(tested);
    let pairs = curvatures.iter().zip(variances);
    pairs.map(|(c, v)| (*c, *v)).collect()
}

/// As [`eliminate_dense`] for the parameters with the most significant scores; for the others nothing is eliminated.
fn eliminate_sparse(
    equations: &NormalEquations,
    slopes: &SparseRows,
    scores: &SparseRows,
    prior: &PriorTerms,
    active: usize,
) -> Vec<Eliminated> {
    let n = equations.diagonal.len();
    let diagonal = &equations.diagonal;
    let hessian = SparseHessian {
        slopes,
        diagonal,
        prior,
    };
    let mut tests: Vec<Eliminated> = (active..n)
        .map(|row| (equations.diagonal[row], equations.scatter[row]))
        .collect();
    let significance = |row: usize| {
        let score = equations.descent[row].max(DVec3::ZERO);
        let scatter = equations.scatter[row];
        let known = scatter.cmpgt(DVec3::ZERO);
        DVec3::select(known, score * score / scatter, DVec3::ZERO).element_sum()
    };
    let mut ranked: Vec<(f64, usize)> = (active..n).map(|r| (significance(r), r)).collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));

    let mut free = vec![DVec3::ZERO; n];
    free[..active].fill(DVec3::ONE);
    let zero = vec![DVec3::ZERO; n];
    let mut added = prior.added.clone();
    added.resize(n, DVec3::ONE);
    let exact: Vec<(usize, Eliminated)> = (ranked.par_iter().take(MAX_EXACT))
        .map(|&(_, row)| {
            let mut unit = vec![DVec3::ZERO; n];
            unit[row] = DVec3::ONE;
            let coupling = slopes.gram_times(&unit);
            // The direction along which the active parameters are optimal.
            let mut direction = hessian.solve(&added, &free, &coupling, &zero, DRAW_TOLERANCE);
            let explained = (0..active)
                .map(|a| coupling[a] * direction[a])
                .sum::<DVec3>();
            direction.iter_mut().for_each(|u| *u = -*u);
            direction[row] = DVec3::ONE;
            let curvature = equations.diagonal[row] - explained;
            (row - active, (curvature, scores.gram_along(&direction)))
        })
        .collect();
    for (index, test) in exact {
        tests[index] = test;
    }
    tests
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::fit::prior::Prior;
    use crate::inverse::unknowns::Unknowns;

    /// The mean of n values of deviation one. With residuals over 1 − 1/n, the variance is the textbook's Σ r² / (n (n − 1))
    /// times n / (n − 1); the plain scores give Σ r² / n².
    #[test]
    fn few_clusters_know_less_than_their_own_scatter_says() {
        for count in [4, 40] {
            let clusters: Vec<Linearised> = (0..count)
                .map(|i| Linearised {
                    own: DVec3::ONE,
                    rows: vec![(0, DVec3::ONE, DVec3::ONE)],
                    ..Linearised::unit(0, DVec3::splat([1.0, -1.0][i % 2]))
                })
                .collect();
            let prior = Prior::new(1, 1, Vec3::ONE);
            let (even, free) = (RobustWeights::even(1), [1]);
            let equations = NormalEquations::new(&clusters, 1, &even, &prior);
            let scores = SparseRows::scores(&clusters, 1, &even, |_| DVec3::ONE);
            let terms = PriorTerms::new(&equations, &free, &Unknowns::new(1));
            let plain = standard_errors(&equations, &terms, &scores, &free, 1).emission[0].x;
            let kept = leave_one_out(&equations, &terms, &clusters, &even);
            let error = standard_errors(&equations, &terms, &kept, &free, 1).emission[0].x;
            let n = count as f32;
            assert!((plain - n.sqrt().recip()).abs() < 1e-4, "{plain}");
            assert!((error - n.sqrt() / (n - 1.0)).abs() < 1e-4, "{error}");
        }
    }

    /// Both path sets disagree about every derivative: the error is multiplied by 1 / [`MIN_SIGNAL`], but not beyond the prior's.
    #[test]
    fn noisy_derivatives_say_no_less_than_the_prior() {
        let clusters: Vec<Linearised> = (0..40)
            .map(|i| Linearised {
                own: DVec3::ONE,
                rows: vec![(0, DVec3::splat(4.0), DVec3::ZERO)],
                ..Linearised::unit(0, DVec3::splat([1.0, -1.0][i % 2]))
            })
            .collect();
        let prior = Prior::new(1, 1, Vec3::ONE);
        let even = RobustWeights::even(1);
        let equations = NormalEquations::new(&clusters, 1, &even, &prior);
        let scores = SparseRows::scores(&clusters, 1, &even, |_| DVec3::ONE);
        let terms = PriorTerms::new(&equations, &[0], &Unknowns::new(1));
        let error = standard_errors(&equations, &terms, &scores, &[0], 1).albedo[0].x;
        assert!((error - ALBEDO_DEVIATION).abs() < 1e-4, "{error}");
    }
}
