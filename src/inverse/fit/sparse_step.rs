//! Steps of the fit with a Hessian of sparse rows, for too many unknowns for dense matrices: the paths of a cluster meet few of the
//! surfaces. Solved by conjugate gradients, for the three channels in parallel.

use crate::inverse::fit::prior_terms::PriorTerms;
use crate::inverse::fit::sparse_rows::SparseRows;
use glam::DVec3;

/// Greatest number of conjugate gradient iterations.
const MAX_ITERATIONS: usize = 200;
/// Relative residual at which conjugate gradients stop.
const TOLERANCE: f64 = 3e-6;
/// Greatest number of changes of the active set of bounds.
const MAX_ACTIVE_SETS: usize = 24;

/// The Hessian H as sparse rows.
#[derive(Clone, Copy)]
pub struct SparseHessian<'a> {
    /// [`SparseRows::slopes`].
    pub slopes: &'a SparseRows,
    /// Its diagonal.
    pub diagonal: &'a [DVec3],
    /// The prior, whose off-diagonal terms are added.
    pub prior: &'a PriorTerms,
}

impl SparseHessian<'_> {
    /// H v with the off-diagonal terms of the prior.
    fn times(&self, v: &[DVec3]) -> Vec<DVec3> {
        let mut product = self.slopes.gram_times(v);
        self.prior.add_coupled(v, &mut product);
        product
    }

    /// Solves (H + D) x = b by preconditioned conjugate gradients from `start`, with D = `added` and b = `right`, over the entries
    /// where `free` is one; the others are zero.
    pub fn solve(
        &self,
        added: &[DVec3],
        free: &[DVec3],
        right: &[DVec3],
        start: &[DVec3],
        tolerance: f64,
    ) -> Vec<DVec3> {
        let n = self.diagonal.len();
        let scale: Vec<DVec3> = (0..n)
            .map(|i| free[i] / (self.diagonal[i] + added[i]).max(DVec3::splat(f64::MIN_POSITIVE)))
            .collect();
        let dot = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| *a * *b).sum::<DVec3>();
        let quotient = |a: DVec3, b: DVec3| DVec3::select(b.cmpgt(DVec3::ZERO), a / b, DVec3::ZERO);
        let mut x: Vec<DVec3> = start.iter().zip(free).map(|(x, f)| *x * *f).collect();
        let mut residual: Vec<DVec3> = right.iter().zip(free).map(|(b, f)| *b * *f).collect();
        let scaled = |residual: &[DVec3]| -> Vec<DVec3> {
            residual.iter().zip(&scale).map(|(r, s)| *r * *s).collect()
        };
        let goal = dot(&residual, &scaled(&residual)) * (tolerance * tolerance);
        if x.iter().any(|x| *x != DVec3::ZERO) {
            let product = self.times(&x);
            for i in 0..n {
                residual[i] -= (product[i] + added[i] * x[i]) * free[i];
            }
        }
        let mut z = scaled(&residual);
        let mut direction = z.clone();
        let mut rz = dot(&residual, &z);
        for _ in 0..MAX_ITERATIONS {
            if !rz.cmpgt(goal).any() {
                break;
            }
            let mut product = self.times(&direction);
            for i in 0..n {
                product[i] = (product[i] + added[i] * direction[i]) * free[i];
            }
            let alpha = quotient(rz, dot(&direction, &product));
            for i in 0..n {
                x[i] += alpha * direction[i];
                residual[i] -= alpha * product[i];
                z[i] = residual[i] * scale[i];
            }
            let next = dot(&residual, &z);
            let beta = quotient(next, rz);
            for i in 0..n {
                direction[i] = z[i] + beta * direction[i];
            }
            rz = next;
        }
        x
    }

    /// Minimises ½ dᵀ(H + D) d − gᵀ d with x + d between zero and `upper` by block principal pivoting (Júdice and Pires 1994),
    /// which changes many parameters at a time between free and held at a bound. D is `added`, and g is `descent`, minus the
    /// gradient at x.
    pub fn bounded_step(
        &self,
        x: &[DVec3],
        descent: &[DVec3],
        added: &[DVec3],
        upper: &[f64],
    ) -> Vec<DVec3> {
        let n = x.len();
        let mut free = vec![DVec3::ONE; n];
        let mut held = vec![DVec3::ZERO; n];
        let mut step = held.clone();
        for _ in 0..MAX_ACTIVE_SETS {
            // Solve for the free parameters, with the others at their bounds.
            let from_held = self.times(&held);
            let right: Vec<DVec3> = (0..n).map(|i| descent[i] - from_held[i]).collect();
            step = self.solve(added, &free, &right, &step, TOLERANCE);
            for i in 0..n {
                step[i] += held[i];
            }
            let product = self.times(&step);

            // Hold parameters that left their bounds, and free those whose gradient points inwards.
            let mut changed = false;
            for i in 0..n {
                let target = x[i] + step[i];
                let slope = descent[i] - product[i] - added[i] * step[i];
                let size = (self.diagonal[i] + added[i]).powf(0.5) * 1e-9;
                let (low, high) = (DVec3::ZERO, DVec3::splat(upper[i]));
                let is_free = free[i].cmpgt(DVec3::ZERO);
                let left = is_free & (target.cmplt(low) | target.cmpgt(high));
                let at_high = held[i].cmpge(high - x[i]);
                let inwards = DVec3::select(at_high, -slope, slope).cmpgt(size) & !is_free;
                if (left | inwards).any() {
                    changed = true;
                    held[i] = DVec3::select(left, target.clamp(low, high) - x[i], held[i]);
                    held[i] = DVec3::select(inwards, DVec3::ZERO, held[i]);
                    free[i] = DVec3::select(left, DVec3::ZERO, free[i]);
                    free[i] = DVec3::select(inwards, DVec3::ONE, free[i]);
                }
            }
            if !changed {
                break;
            }
        }
        step
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::fit::equations::{Coupling, NormalEquations};
    use crate::inverse::fit::errors::{score_tests, standard_errors};
    use crate::inverse::fit::gauss_newton::propose;
    use crate::inverse::fit::prior::Prior;
    use crate::inverse::fit::robust_weights::RobustWeights;
    use crate::inverse::paths::evaluate::Linearised;
    use crate::inverse::sky::ExpectedSky;
    use crate::inverse::unknowns::Unknowns;
    use crate::math::rng::Stream;
    use glam::Vec3;
    use nalgebra::{DMatrix, DVector};

    const SURFACES: usize = 40;
    /// All albedos and the first ten emissions.
    const FREE: usize = SURFACES + 10;

    /// Clusters that each depend on their own object and a few other parameters. The unbounded solution lies partly outside
    /// the bounds.
    fn clusters() -> Vec<Linearised> {
        let mut stream = Stream::new(61, 0, 0, 0);
        (0..600)
            .map(|index| {
                let object = index % SURFACES;
                let mut color = |size: f64| {
                    DVec3::from_array(std::array::from_fn(|_| size * f64::from(stream.uniform())))
                };
                let mut rows = vec![(object, color(1.0), color(1.0))];
                for other in 1..6 {
                    let parameter = (object * 7 + other * 11 + index) % FREE;
                    if rows.iter().all(|r| r.0 != parameter) {
                        rows.push((parameter, color(0.3), color(0.3)));
                    }
                }
                let pull = if object.is_multiple_of(3) { -1.5 } else { 0.4 };
                let residual = rows[0].1 * pull + color(0.3);
                rows.sort_unstable_by_key(|row| row.0);
                Linearised {
                    weight: DVec3::ONE + color(1.0),
                    residuals: [residual, residual + color(0.05)],
                    rows,
                    ..Linearised::unit(object as u32, DVec3::ZERO)
                }
            })
            .collect()
    }

    /// The equations with matrices and with sparse rows, and the clusters' scores.
    fn both() -> ([NormalEquations; 2], SparseRows) {
        let clusters = clusters();
        let even = RobustWeights::even(SURFACES);
        let prior = Prior::new(SURFACES, SURFACES, Vec3::ONE);
        let equations = [FREE, 0].map(|max_dense| {
            NormalEquations::with_at_most(max_dense, &clusters, FREE, &even, &prior)
        });
        let scores = SparseRows::scores(&clusters, FREE, &even, |_| DVec3::ONE);
        (equations, scores)
    }

    #[test]
    fn rows_take_the_same_bounded_step_as_matrices() {
        let free: Vec<usize> = (0..FREE).collect();
        let from = Unknowns::new(SURFACES);
        let [dense, sparse] = both().0.map(|e| {
            let terms = PriorTerms::new(&e, &free, &from);
            propose(&e, &terms, &free, &from, 1e-10).0
        });
        let mut at_bounds = 0;
        for &i in &free {
            assert!((dense.value(i) - sparse.value(i)).length() < 1e-5, "{i}");
            at_bounds += usize::from(dense.value(i).min_element() == 0.0);
        }
        assert!(at_bounds > 5 && at_bounds < FREE, "{at_bounds}");
    }

    #[test]
    fn drawn_standard_errors_are_those_of_matrices() {
        let free: Vec<usize> = (0..FREE).collect();
        let (equations, scores) = both();
        let [dense, sparse] = equations.map(|e| {
            let terms = PriorTerms::new(&e, &free, &Unknowns::new(SURFACES));
            standard_errors(&e, &terms, &scores, &free, SURFACES)
        });
        let ratios: Vec<f64> = (dense.albedo.iter().zip(&sparse.albedo))
            .flat_map(|(a, b)| (*b / *a).to_array())
            .map(f64::from)
            .collect();
        let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
        // Each is within 10 %, one standard deviation; 120 of them together within about 2 %.
        assert!((mean - 1.0).abs() < 0.05, "{mean}");
        assert!(ratios.iter().all(|r| (r - 1.0).abs() < 0.5), "{ratios:?}");
    }

    #[test]
    fn what_is_released_is_tested_alike() {
        let free: Vec<usize> = (0..FREE).collect();
        let (equations, scores) = both();
        let [dense, sparse] = equations.map(|e| {
            let terms = PriorTerms::new(&e, &free[..SURFACES], &Unknowns::new(SURFACES));
            score_tests(&e, &terms, &scores, &free)
        });
        for (a, b) in dense.iter().zip(&sparse) {
            for c in 0..3 {
                for ratio in [a.step[c] / b.step[c], a.stderr[c] / b.stderr[c]] {
                    assert!((ratio - 1.0).abs() < 0.05, "{a:?} {b:?}");
                }
            }
        }
    }

    fn two_directions() -> ExpectedSky {
        ExpectedSky {
            radiance: vec![Vec3::new(1.0, 2.0, 3.0), Vec3::ONE],
            covariance: Some(DMatrix::from_row_slice(2, 2, &[0.5, 0.4, 0.4, 0.6])),
            has_color: vec![true; 2],
            shape: Vec::new(),
        }
    }

    /// Two correlated directions beside the other parameters: the sparse rows solve the same system as its matrix.
    #[test]
    fn a_correlated_prior_is_solved_as_with_matrices() {
        const SEEN: usize = SURFACES - 2;
        let prior = Prior::new(SURFACES, SEEN, Vec3::ONE).with_sky(Some(&two_directions()));
        let free: Vec<usize> = (0..FREE - 2)
            .chain([SURFACES + SEEN, SURFACES + SEEN + 1])
            .collect();
        let (clusters, even) = (clusters(), RobustWeights::even(SURFACES));
        let at = Unknowns::new(SURFACES);
        let dense = NormalEquations::new(&clusters, FREE, &even, &prior);
        let terms = PriorTerms::new(&dense, &free, &at);
        assert!(terms.couplings(1).all(|(_, _, value)| value < 0.0) && terms.block.is_some());
        let slopes = SparseRows::slopes(&clusters, FREE, &even);
        let hessian = SparseHessian {
            slopes: &slopes,
            diagonal: &dense.diagonal,
            prior: &terms,
        };
        let values: Vec<DVec3> = free.iter().map(|&i| at.value(i).as_dvec3()).collect();
        let (right, one) = (terms.pull(&values), vec![DVec3::ONE; FREE]);
        let found = hessian.solve(&terms.added, &one, &right, &vec![DVec3::ZERO; FREE], 1e-9);
        let Coupling::Dense(hessians) = &dense.coupling else {
            panic!("few parameters have matrices");
        };
        for c in 0..3 {
            let mut matrix = terms.couple(&hessians[c], c).into_owned();
            matrix.fill_upper_triangle_with_lower_triangle();
            for (row, added) in terms.added.iter().enumerate() {
                matrix[(row, row)] += added[c];
            }
            let right = DVector::from_iterator(FREE, right.iter().map(|v| v[c]));
            let solution = matrix.cholesky().expect("definite").solve(&right);
            for (a, b) in found.iter().zip(solution.iter()) {
                assert!((a[c] - b).abs() < 1e-4 * solution.amax(), "{} {b}", a[c]);
            }
        }
    }

    /// The pull of a correlated prior is minus half the derivative of its squared distance, by finite differences.
    #[test]
    fn a_correlated_prior_pulls_downhill() {
        let prior = Prior::new(SURFACES, SURFACES - 2, Vec3::ONE);
        let prior = prior.with_sky(Some(&two_directions()));
        let free: Vec<usize> = (2 * SURFACES - FREE..2 * SURFACES).collect();
        let at = Unknowns::new(SURFACES);
        let even = RobustWeights::even(SURFACES);
        let equations = NormalEquations::new(&clusters(), FREE, &even, &prior);
        let terms = PriorTerms::new(&equations, &free, &at);
        let distance = |x: &[DVec3]| -> DVec3 {
            let pull = terms.pull(x);
            (pull.iter().zip(x).zip(&terms.mean))
                .map(|((p, x), m)| *p * (*m - *x))
                .sum()
        };
        let x: Vec<DVec3> = (0..FREE)
            .map(|i| DVec3::splat(0.1 * (i % 7) as f64))
            .collect();
        let pull = terms.pull(&x);
        for row in FREE - 4..FREE {
            let moved = |step: f64| {
                let mut x = x.clone();
                x[row] += step;
                distance(&x)
            };
            let slope = (moved(1e-4) - moved(-1e-4)) / -4e-4;
            let size = pull[row].abs().max_element().max(1e-3);
            assert!(
                (slope - pull[row]).abs().max_element() < 1e-5 * size,
                "{slope} {}",
                pull[row]
            );
        }
    }
}
