//! How sure a fit is: standard errors of what was fitted, and tests of what was left out.

use crate::inverse::fit::equations::{Coupling, Matrices, NormalEquations};
use crate::inverse::fit::gauss_newton::noise;
use crate::inverse::fit::prior::ALBEDO_DEVIATION;
use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::fit::rows::Rows;
use crate::inverse::paths::evaluate::Linearised;
use crate::math::rng::Stream;
use glam::{DVec3, Vec3};
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

/// Draws that standard errors are taken from where matrices would be too large: they are then within some 10 % of what
/// matrices would give.
const DRAWS: u64 = 48;
/// Relative residual of a draw's solution.
const DRAW_TOLERANCE: f64 = 1e-2;
/// Key of the draws.
const KEY: u64 = 0x6d75_6c74;
/// Parameters that are tested exactly where matrices would be too large.
const MAX_EXACT: usize = 24;
/// Fraction of a curvature that is taken not to be noise at least.
const MIN_SIGNAL: f64 = 0.05;
/// Fraction of a cluster's residual that it is taken to keep at least when the fit follows it.
const MIN_KEPT: f64 = 0.1;
/// Fraction of its curvature that a parameter must keep when the others follow it, to be told apart from them.
const MIN_OWN: f64 = 1e-9;

/// Standard errors of all parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct StandardErrors {
    /// Of each object's albedo; the prior's deviation where nothing is known.
    pub albedo: Vec<Vec3>,
    /// Of each object's emission; infinite where nothing is known.
    pub emission: Vec<Vec3>,
}

/// A parameter that was held fixed, and what the photographs say of setting it free.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Released {
    /// Index into albedos, then emissions.
    pub index: usize,
    /// The step it would take, per channel.
    pub step: [f64; 3],
    /// Standard error of that step, per channel.
    pub stderr: [f64; 3],
    /// Half the second derivative of the squared error along it when the active ones follow, per channel.
    pub curvature: [f64; 3],
}

impl Released {
    /// χ² of three degrees of freedom over the channels that would rise.
    pub fn significance(&self) -> f64 {
        (0..3)
            .filter(|&c| self.step[c] > 0.0 && self.stderr[c] > 0.0)
            .map(|c| (self.step[c] / self.stderr[c]).powi(2))
            .sum()
    }

    /// By how much the squared error falls over the channels that would rise.
    pub fn gain(&self) -> f64 {
        (0..3)
            .filter(|&c| self.step[c] > 0.0)
            .map(|c| self.step[c].powi(2) * self.curvature[c])
            .sum()
    }
}

/// Standard errors of the parameters in `free`: the sandwich (H + P)⁻¹ (S + vP) (H + P)⁻¹ with S the scatter of the
/// clusters' scores, so that noise of photographs and of paths both count, whatever their distribution (Huber 1967).
///
/// H holds the square of the derivatives' own noise, which the descent does not: what few paths meet would seem better known
/// than it is. Errors grow by the fraction of that noise in the parameter's curvature.
pub fn standard_errors(
    equations: &NormalEquations,
    free: &[usize],
    objects: usize,
) -> StandardErrors {
    let beliefs = Beliefs::new(equations, free);
    let variances = match &equations.coupling {
        Coupling::Dense(matrices) => sandwich(matrices, &beliefs),
        Coupling::Sparse(rows) => multipliers(rows, &beliefs),
    };
    let mut errors = StandardErrors {
        albedo: vec![Vec3::splat(ALBEDO_DEVIATION); objects],
        emission: vec![Vec3::INFINITY; objects],
    };
    let curvatures = equations.diagonal.iter().zip(&equations.across);
    for ((&index, variance), (diagonal, across)) in free.iter().zip(variances).zip(curvatures) {
        let noisy = (*diagonal / signal(*diagonal, *across)).max(DVec3::ONE);
        let error = (variance.max(DVec3::ZERO).powf(0.5) * noisy).as_vec3();
        let target = match index.checked_sub(objects) {
            None => &mut errors.albedo[index],
            Some(emitter) => &mut errors.emission[emitter],
        };
        let known = diagonal.cmpgt(DVec3::ZERO) & variance.cmpge(DVec3::ZERO);
        *target = Vec3::select(known, error, *target);
    }
    errors
}

/// The same equations with the scatter that the clusters' scores have before the fit follows them: each over what it keeps
/// of its residual, one less its leverage (MacKinnon and White 1985, HC3). Few clusters know a lamp or a small object, and
/// the fit goes through them as if they had no noise. Matrices only: where unknowns are so many that rows take their place, the
/// scatter stays what is left, and errors of what few clusters see are too small.
pub fn jackknifed(
    mut equations: NormalEquations,
    clusters: &[Linearised],
    robust: &RobustWeights,
    free: &[usize],
) -> NormalEquations {
    let beliefs = Beliefs::new(&equations, free);
    if let Coupling::Dense(matrices) = &mut equations.coupling {
        let inverses = [0, 1, 2].map(|c| inverse(&matrices.hessian[c], &beliefs.added, c));
        let kept: Vec<DVec3> = (clusters.par_iter())
            .map(|cluster| {
                let weight = robust.weight(cluster);
                DVec3::from_array(std::array::from_fn(|c| {
                    let leverage = (inverses[c].as_ref()).map_or(0.0, |m| along(m, cluster, c));
                    (1.0 - weight[c] * leverage).max(MIN_KEPT)
                }))
            })
            .collect();
        *matrices = Matrices::with_residuals_kept(clusters, free.len(), robust, &kept);
    }
    equations
}

/// J̄ᵀ M J̄ of a cluster's derivatives in one channel.
fn along(matrix: &DMatrix<f64>, cluster: &Linearised, channel: usize) -> f64 {
    let slope = |&(row, a, b): &(usize, DVec3, DVec3)| (row, 0.5 * (a[channel] + b[channel]));
    let mut sum = 0.0;
    for (i, left) in cluster.rows.iter().map(slope) {
        let column = matrix.column(i);
        let product: f64 = cluster
            .rows
            .iter()
            .map(slope)
            .map(|(j, right)| column[j] * right)
            .sum();
        sum += left * product;
    }
    sum
}

/// The part of a parameter's curvature that is no noise of its derivatives, given its curvature and that across the two sets.
pub fn signal(diagonal: DVec3, across: DVec3) -> DVec3 {
    across.max(diagonal * MIN_SIGNAL)
}

/// What is believed of the free parameters, in the units of the normal equations.
struct Beliefs {
    /// Precision of each.
    precision: Vec<DVec3>,
    /// What keeps the diagonal positive where no path touches.
    added: Vec<DVec3>,
    /// Variance of one cluster.
    variance: DVec3,
}

impl Beliefs {
    fn new(equations: &NormalEquations, free: &[usize]) -> Self {
        let variance = noise(equations);
        let precision: Vec<DVec3> = (free.iter())
            .map(|&i| equations.prior.of(i, variance).1)
            .collect();
        let added = (precision.iter().zip(&equations.diagonal))
            .map(|(p, d)| *p + DVec3::select(d.cmpgt(DVec3::ZERO), DVec3::ZERO, DVec3::ONE))
            .collect();
        Self {
            precision,
            added,
            variance,
        }
    }
}

/// Inverse of one channel's Hessian over the first parameters with `added` on its diagonal, damped where it must be.
fn inverse(hessian: &DMatrix<f64>, added: &[DVec3], channel: usize) -> Option<DMatrix<f64>> {
    let n = added.len();
    let mut damping = 0.0;
    while damping < 1e6 {
        let matrix = DMatrix::from_fn(n, n, |a, b| {
            let h = hessian[(a.max(b), a.min(b))];
            h + if a == b {
                added[a][channel] + damping * h
            } else {
                0.0
            }
        });
        if let Some(cholesky) = Cholesky::new(matrix) {
            return Some(cholesky.inverse());
        }
        damping = (damping * 10.0).max(1e-9);
    }
    None
}

/// Variances by matrices; negative where a channel has no inverse.
fn sandwich(matrices: &Matrices, beliefs: &Beliefs) -> Vec<DVec3> {
    let n = beliefs.added.len();
    let mut variances = vec![DVec3::NEG_ONE; n];
    for channel in 0..3 {
        let Some(bread) = inverse(&matrices.hessian[channel], &beliefs.added, channel) else {
            continue;
        };
        let scatter = &matrices.scatter[channel];
        let meat = DMatrix::from_fn(n, n, |a, b| {
            let own = beliefs.variance[channel] * beliefs.precision[a][channel];
            scatter[(a.max(b), a.min(b))] + if a == b { own } else { 0.0 }
        });
        let covariance = &bread * meat * &bread;
        for (a, variance) in variances.iter_mut().enumerate() {
            variance[channel] = covariance[(a, a)];
        }
    }
    variances
}

/// The same variances from random draws: with signs ε of the clusters, (H + P)⁻¹ Σ ε g scatters as the estimate does
/// (the multiplier bootstrap, Wu 1986).
fn multipliers(rows: &Rows, beliefs: &Beliefs) -> Vec<DVec3> {
    let n = beliefs.added.len();
    let (free, none) = (vec![DVec3::ONE; n], vec![DVec3::ZERO; n]);
    let draws: Vec<Vec<DVec3>> = (0..DRAWS)
        .into_par_iter()
        .map(|draw| {
            let sign = |kind: u64, index: usize| {
                let bit = Stream::new(draw, kind, index as u64, KEY).below(2);
                DVec3::splat([-1.0, 1.0][bit])
            };
            let mut right = rows.scores_times(|cluster| sign(0, cluster));
            for (i, b) in right.iter_mut().enumerate() {
                *b += (beliefs.variance * beliefs.precision[i]).powf(0.5) * sign(1, i);
            }
            rows.solve(&beliefs.added, &free, &right, &none, DRAW_TOLERANCE)
        })
        .collect();
    (0..n)
        .map(|i| draws.iter().map(|z| z[i] * z[i]).sum::<DVec3>() / DRAWS as f64)
        .collect()
}

/// For each parameter of `free` after the first `active` ones: the step it would take if it alone were set free besides
/// the active ones, with its standard error (a score test, Rao 1948).
pub fn release(equations: &NormalEquations, free: &[usize], active: usize) -> Vec<Released> {
    let beliefs = Beliefs::new(equations, &free[..active]);
    let mut released: Vec<Released> = (free[active..].iter())
        .map(|&index| Released {
            index,
            step: [0.0; 3],
            stderr: [f64::INFINITY; 3],
            curvature: [0.0; 3],
        })
        .collect();
    let tests = match &equations.coupling {
        Coupling::Dense(matrices) => by_matrices(equations, matrices, &beliefs, active),
        Coupling::Sparse(rows) => by_rows(equations, rows, &beliefs, active),
    };
    for ((result, tested), row) in released.iter_mut().zip(tests).zip(active..) {
        let (diagonal, score) = (equations.diagonal[row], equations.descent[row]);
        for channel in 0..3 {
            let curvature = tested.curvature[channel];
            if curvature > MIN_OWN * diagonal[channel] && curvature > 0.0 {
                result.curvature[channel] = curvature;
                result.step[channel] = score[channel] / curvature;
                result.stderr[channel] = tested.variance[channel].max(0.0).sqrt() / curvature;
            }
        }
    }
    released
}

/// What is left of a parameter when the active ones follow it.
struct Tested {
    /// Its curvature.
    curvature: DVec3,
    /// The variance of its score.
    variance: DVec3,
}

fn by_matrices(
    equations: &NormalEquations,
    matrices: &Matrices,
    beliefs: &Beliefs,
    active: usize,
) -> Vec<Tested> {
    let n = equations.diagonal.len();
    let mut tests: Vec<Tested> = (active..n).map(|_| Tested::none()).collect();
    for channel in 0..3 {
        let (hessian, scatter) = (&matrices.hessian[channel], &matrices.scatter[channel]);
        let Some(inverse) = inverse(hessian, &beliefs.added, channel) else {
            continue;
        };
        let active_scatter = DMatrix::from_fn(active, active, |a, b| scatter[(a.max(b), a.min(b))]);
        for (row, test) in (active..n).zip(&mut tests) {
            let coupling = DVector::from_fn(active, |a, _| hessian[(row, a)]);
            let u = &inverse * &coupling;
            let shared = DVector::from_fn(active, |a, _| scatter[(row, a)]);
            test.curvature[channel] = hessian[(row, row)] - coupling.dot(&u);
            test.variance[channel] =
                scatter[(row, row)] - 2.0 * u.dot(&shared) + u.dot(&(&active_scatter * &u));
        }
    }
    tests
}

/// As [`by_matrices`], exactly for the parameters whose scores stand out most; the others as if nothing followed them.
fn by_rows(
    equations: &NormalEquations,
    rows: &Rows,
    beliefs: &Beliefs,
    active: usize,
) -> Vec<Tested> {
    let n = equations.diagonal.len();
    let mut tests: Vec<Tested> = (active..n)
        .map(|row| Tested {
            curvature: equations.diagonal[row],
            variance: equations.scatter[row],
        })
        .collect();
    let significance = |row: usize| {
        let (score, scatter) = (
            equations.descent[row].max(DVec3::ZERO),
            equations.scatter[row],
        );
        let known = scatter.cmpgt(DVec3::ZERO);
        DVec3::select(known, score * score / scatter, DVec3::ZERO).element_sum()
    };
    let mut standing_out: Vec<(f64, usize)> = (active..n).map(|r| (significance(r), r)).collect();
    standing_out.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));

    let is_active = |row: usize| {
        if row < active {
            DVec3::ONE
        } else {
            DVec3::ZERO
        }
    };
    let free: Vec<DVec3> = (0..n).map(is_active).collect();
    let none = vec![DVec3::ZERO; n];
    let mut added = beliefs.added.clone();
    added.resize(n, DVec3::ONE);
    let exact: Vec<(usize, Tested)> = (standing_out.par_iter().take(MAX_EXACT))
        .map(|&(_, row)| {
            let mut unit = vec![DVec3::ZERO; n];
            unit[row] = DVec3::ONE;
            let coupling = rows.hessian_times(&unit);
            let mut follow = rows.solve(&added, &free, &coupling, &none, DRAW_TOLERANCE);
            let followed = (0..active).map(|a| coupling[a] * follow[a]).sum::<DVec3>();
            follow.iter_mut().for_each(|u| *u = -*u);
            follow[row] = DVec3::ONE;
            let test = Tested {
                curvature: equations.diagonal[row] - followed,
                variance: rows.scatter_along(&follow),
            };
            (row - active, test)
        })
        .collect();
    for (index, test) in exact {
        tests[index] = test;
    }
    tests
}

impl Tested {
    fn none() -> Self {
        Self {
            curvature: DVec3::ZERO,
            variance: DVec3::ZERO,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::fit::prior::Prior;
    use glam::BVec3;

    /// The mean of `count` values of deviation one: with its residuals over what each keeps, one less 1/n, its variance is
    /// the textbook's Σ r² / (n (n - 1)) times n / (n - 1), and not the Σ r² / n² that the scores alone would say.
    #[test]
    fn few_clusters_know_less_than_their_own_scatter_says() {
        for count in [4, 40] {
            let clusters: Vec<Linearised> = (0..count)
                .map(|i| Linearised {
                    object: 0,
                    weight: DVec3::ONE,
                    pixels: 1.0,
                    residuals: [DVec3::splat([1.0, -1.0][i % 2]); 2],
                    censored: BVec3::FALSE,
                    own: DVec3::ONE,
                    rows: vec![(0, DVec3::ONE, DVec3::ONE)],
                })
                .collect();
            let prior = Prior::new(1, 1, Vec3::ONE);
            let (even, free) = (RobustWeights::even(1), [1]);
            let equations = NormalEquations::new(&clusters, 1, &even, &prior);
            let plain = standard_errors(&equations, &free, 1).emission[0].x;
            let kept = jackknifed(equations, &clusters, &even, &free);
            let error = standard_errors(&kept, &free, 1).emission[0].x;
            let n = count as f32;
            assert!((plain - n.sqrt().recip()).abs() < 1e-4, "{plain}");
            assert!((error - n.sqrt() / (n - 1.0)).abs() < 1e-4, "{error}");
        }
    }
}
