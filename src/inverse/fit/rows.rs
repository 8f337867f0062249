//! Normal equations as the clusters' sparse rows, for too many unknowns for dense matrices: the paths of a cluster meet few of
//! the surfaces. Solved by conjugate gradients, for the three channels in parallel.

use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::paths::evaluate::Linearised;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Number of partial sums over clusters; fixed, for the same bits on any number of threads.
const PARTS: usize = 8;
/// Greatest number of conjugate gradient iterations.
const MAX_ITERATIONS: usize = 200;
/// Relative residual at which conjugate gradients stop.
const TOLERANCE: f64 = 3e-6;
/// Greatest number of changes of the active set of bounds.
const MAX_ACTIVE_SETS: usize = 24;

/// A non-zero entry of a cluster's row; in f32, since memory bandwidth is the bottleneck.
#[derive(Debug, Clone, Copy)]
struct Entry {
    parameter: u32,
    value: Vec3,
}

/// The rows of all clusters.
#[derive(Debug, Clone)]
pub struct Rows {
    /// √w J̄ with J̄ the mean derivative of both sets.
    slopes: Vec<Entry>,
    /// Contributions to the descent direction.
    scores: Vec<Entry>,
    /// End of each cluster in both.
    ends: Vec<usize>,
    /// Σ w J̄² of each parameter.
    pub diagonal: Vec<DVec3>,
}

impl Rows {
    /// From linearised clusters with `n` free parameters.
    pub fn new(linearised: &[Linearised], n: usize, robust: &RobustWeights) -> Self {
        let parts: Vec<Self> = (linearised.par_chunks(linearised.len().div_ceil(PARTS).max(1)))
            .map(|clusters| Self::part(clusters, n, robust))
            .collect();
        let mut all = Self::part(&[], n, robust);
        for part in parts {
            let before = all.slopes.len();
            all.slopes.extend(part.slopes);
            all.scores.extend(part.scores);
            all.ends.extend(part.ends.iter().map(|end| before + end));
            for (sum, more) in all.diagonal.iter_mut().zip(part.diagonal) {
                *sum += more;
            }
        }
        all
    }

    fn part(clusters: &[Linearised], n: usize, robust: &RobustWeights) -> Self {
        let mut this = Self {
            slopes: Vec::new(),
            scores: Vec::new(),
            ends: Vec::with_capacity(clusters.len()),
            diagonal: vec![DVec3::ZERO; n],
        };
        for cluster in clusters {
            let weight = robust.weight(cluster);
            let root = weight.powf(0.5);
            for (&(parameter, a, b), score) in cluster.rows.iter().zip(cluster.scores(weight)) {
                let slope = root * (a + b) * 0.5;
                this.diagonal[parameter] += slope * slope;
                let entry = |value: DVec3| Entry {
                    parameter: parameter as u32,
                    value: value.as_vec3(),
                };
                this.slopes.push(entry(slope));
                this.scores.push(entry(score));
            }
            this.ends.push(this.slopes.len());
        }
        this
    }

    /// Σ f e over the entries e of all clusters, with a factor f of each cluster, from its index and entries.
    fn sum(
        &self,
        entries: &[Entry],
        factor: impl Fn(usize, &[Entry]) -> DVec3 + Sync,
    ) -> Vec<DVec3> {
        let clusters = self.ends.len();
        let parts: Vec<Vec<DVec3>> = (0..PARTS)
            .into_par_iter()
            .map(|part| {
                let mut sum = vec![DVec3::ZERO; self.diagonal.len()];
                for cluster in part * clusters / PARTS..(part + 1) * clusters / PARTS {
                    let start = cluster.checked_sub(1).map_or(0, |before| self.ends[before]);
                    let own = &entries[start..self.ends[cluster]];
                    let factor = factor(cluster, own);
                    for entry in own {
                        sum[entry.parameter as usize] += entry.value.as_dvec3() * factor;
                    }
                }
                sum
            })
            .collect();
        let mut total = vec![DVec3::ZERO; self.diagonal.len()];
        for part in parts {
            for (sum, more) in total.iter_mut().zip(part) {
                *sum += more;
            }
        }
        total
    }

    /// H v with H = Σ w J̄ J̄ᵀ.
    pub fn hessian_times(&self, v: &[DVec3]) -> Vec<DVec3> {
        self.sum(&self.slopes, |_, own| dot(own, v))
    }

    /// Σ f g with a cluster's contribution g to the descent direction and its factor f.
    pub fn scores_times(&self, factor: impl Fn(usize) -> DVec3 + Sync) -> Vec<DVec3> {
        self.sum(&self.scores, |cluster, _| factor(cluster))
    }

    /// vᵀ S v with S = Σ g gᵀ.
    pub fn scatter_along(&self, v: &[DVec3]) -> DVec3 {
        let mut start = 0;
        let mut sum = DVec3::ZERO;
        for &end in &self.ends {
            let score = dot(&self.scores[start..end], v);
            sum += score * score;
            start = end;
        }
        sum
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
            let product = self.hessian_times(&x);
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
            let mut product = self.hessian_times(&direction);
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
            let from_held = self.hessian_times(&held);
            let right: Vec<DVec3> = (0..n).map(|i| descent[i] - from_held[i]).collect();
            step = self.solve(added, &free, &right, &step, TOLERANCE);
            for i in 0..n {
                step[i] += held[i];
            }
            let product = self.hessian_times(&step);

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

/// Dot product of a sparse row with a vector.
fn dot(entries: &[Entry], v: &[DVec3]) -> DVec3 {
    (entries.iter())
        .map(|e| e.value.as_dvec3() * v[e.parameter as usize])
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::fit::equations::{Coupling, Matrices, NormalEquations};
    use crate::inverse::fit::errors::{score_tests, standard_errors};
    use crate::inverse::fit::gauss_newton::propose;
    use crate::inverse::fit::prior::Prior;
    use crate::inverse::unknowns::Unknowns;
    use crate::math::rng::Stream;
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
                Linearised {
                    weight: DVec3::ONE + color(1.0),
                    residuals: [residual, residual + color(0.05)],
                    rows,
                    ..Linearised::unit(object as u32, DVec3::ZERO)
                }
            })
            .collect()
    }

    fn both() -> [NormalEquations; 2] {
        let linearised = clusters();
        let (even, prior) = (
            RobustWeights::even(SURFACES),
            Prior::new(SURFACES, SURFACES, Vec3::ONE),
        );
        [
            Coupling::Dense(Matrices::new(&linearised, FREE, &even)),
            Coupling::Sparse(Rows::new(&linearised, FREE, &even)),
        ]
        .map(|c| NormalEquations::with_coupling(&linearised, FREE, &even, &prior, c))
    }

    #[test]
    fn rows_take_the_same_bounded_step_as_matrices() {
        let free: Vec<usize> = (0..FREE).collect();
        let from = Unknowns::new(SURFACES);
        let [dense, sparse] = both().map(|e| propose(&e, &free, &from, 1e-10).0);
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
        let [dense, sparse] = both().map(|e| standard_errors(&e, &free, SURFACES));
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
        let [dense, sparse] = both().map(|e| score_tests(&e, &free, SURFACES));
        for (a, b) in dense.iter().zip(&sparse) {
            for c in 0..3 {
                for ratio in [a.step[c] / b.step[c], a.stderr[c] / b.stderr[c]] {
                    assert!((ratio - 1.0).abs() < 0.05, "{a:?} {b:?}");
                }
            }
        }
    }
}
