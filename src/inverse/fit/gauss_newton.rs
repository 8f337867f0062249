//! Finds the zero of the unbiased descent direction within bounds by Gauss–Newton steps.

use crate::inverse::fit::equations::{Coupling, NormalEquations, per_channel};
use crate::inverse::fit::prior::Prior;
use crate::inverse::fit::prior_terms::PriorTerms;
use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::fit::sparse_step::SparseHessian;
use crate::inverse::fit::step::Step;
use crate::inverse::paths::PathCache;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::roles::places;
use crate::inverse::unknowns::Unknowns;
use glam::DVec3;
use nalgebra::{DMatrix, DVector};

/// Damping relative to the diagonal; only guards the factorisation against rounding.
pub const MIN_DAMPING: f64 = 1e-10;
/// A step below this many standard errors in every parameter ends the fit.
pub const STEP_TOLERANCE: f64 = 0.1;
/// The fit also ends if the relative squared gradient is below this, ...
const WITHIN_NOISE: f64 = 2.0;
/// ... and the last step left more than this fraction of it.
const STALLED: f64 = 0.9;
/// A few units in the last place of single precision, over [`STEP_TOLERANCE`].
const ROUNDING: f64 = 4.0 * f32::EPSILON as f64 / STEP_TOLERANCE;

/// The result of a fit.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The unknowns.
    pub unknowns: Unknowns,
    /// The clusters linearised at the unknowns, with one row per free parameter.
    pub clusters: Vec<Linearised>,
    /// The normal equations of these.
    pub equations: NormalEquations,
    /// The prior's terms in the equations.
    pub terms: PriorTerms,
    /// Number of steps taken.
    pub iterations: u64,
}

/// Fits the free parameters (indices into albedos, then emissions). `between` receives the equations after
/// every step; its error ends the fit.
///
/// # Errors
/// The error of `between`.
pub fn fit<E>(
    cache: &PathCache,
    start: &Unknowns,
    free: &[usize],
    robust: &RobustWeights,
    prior: &Prior,
    max_steps: u64,
    mut between: impl FnMut(&NormalEquations) -> Result<(), E>,
) -> Result<Fit, E> {
    let row_of = places(free, start.surfaces());
    let linearised = |unknowns: &Unknowns| {
        let clusters = cache.linearise(unknowns, &row_of, &[]);
        let equations = NormalEquations::new(&clusters, free.len(), robust, prior);
        (clusters, equations)
    };
    let mut unknowns = start.clone();
    let (mut clusters, mut equations) = linearised(&unknowns);
    let mut terms = PriorTerms::new(&equations, free, &unknowns);
    let mut iterations = 0;
    let mut damping = MIN_DAMPING;
    let mut before = f64::INFINITY;
    while iterations < max_steps {
        let gradient = relative_gradient(&equations, &terms, free, &unknowns);
        if is_stalled(before, gradient) {
            break;
        }
        let (proposal, length) = propose(&equations, &terms, free, &unknowns, damping);
        let (clusters_after, after) = linearised(&proposal);
        iterations += 1;
        between(&after)?;
        // Retry with more damping after an overshoot.
        if worse(&equations, &after) && damping < 1e3 {
            damping = (damping * 100.0).max(1e-3);
            continue;
        }
        damping = (damping * 0.01).max(MIN_DAMPING);
        (unknowns, clusters, equations, before) = (proposal, clusters_after, after, gradient);
        terms = PriorTerms::new(&equations, free, &unknowns);
        if length.step < STEP_TOLERANCE {
            break;
        }
    }
    Ok(Fit {
        unknowns,
        clusters,
        equations,
        terms,
        iterations,
    })
}

/// Whether the squared error of any channel increased clearly.
fn worse(before: &NormalEquations, after: &NormalEquations) -> bool {
    let rise = after.objective - before.objective;
    !after.objective.is_finite() || rise.cmpgt(before.objective.abs() * 0.5).any()
}

/// Whether only noise is left, given [`relative_gradient`] before and after a step. If many unknowns share few paths, further
/// steps would follow path noise without end: the product across two sets may have negative curvature.
pub fn is_stalled(before: f64, after: f64) -> bool {
    after < WITHIN_NOISE && after > STALLED * before
}

/// Sum over parameters of the squared gradient over the curvature, relative to its expectation from noise alone. Gradients that
/// point out of the bounds do not count. About one if only noise is left.
pub fn relative_gradient(
    equations: &NormalEquations,
    prior: &PriorTerms,
    free: &[usize],
    at: &Unknowns,
) -> f64 {
    let (mut total, mut expected) = (0.0, 0.0);
    let gradients = gradients(equations, prior, free, at).into_iter();
    for (row, (gradient, &i)) in gradients.zip(free).enumerate() {
        let curvature = equations.diagonal[row];
        for channel in 0..3 {
            let [g, h] = [gradient, curvature].map(|v| v[channel]);
            if h > 0.0 && !at.is_held(i, channel, g) {
                total += g * g / h;
                expected += equations.scatter[row][channel] / h;
            }
        }
    }
    if expected > 0.0 {
        total / expected
    } else {
        0.0
    }
}

/// The direction of descent of each free parameter, including the prior.
fn gradients(
    equations: &NormalEquations,
    prior: &PriorTerms,
    free: &[usize],
    at: &Unknowns,
) -> Vec<DVec3> {
    let values: Vec<DVec3> = free.iter().map(|&i| at.value(i).as_dvec3()).collect();
    let pulls = prior.pull(&values);
    (equations.descent.iter().zip(pulls))
        .map(|(g, pull)| *g + pull)
        .collect()
}

/// The largest component of a step, in standard errors of the parameters.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct StepLength {
    /// Of the step itself.
    pub step: f64,
    /// Extrapolated over all following steps: the noise of the derivatives makes each step too short by the ratio of
    /// [`NormalEquations::diagonal`] to [`NormalEquations::across`].
    pub remaining: f64,
}

/// The unknowns after one bounded step from `from`, and the step's length.
pub fn propose(
    equations: &NormalEquations,
    prior: &PriorTerms,
    free: &[usize],
    from: &Unknowns,
    damping: f64,
) -> (Unknowns, StepLength) {
    let x: Vec<DVec3> = free.iter().map(|&i| from.value(i).as_dvec3()).collect();
    let descent = gradients(equations, prior, free, from);
    let added = |damping: f64| -> Vec<DVec3> {
        (prior.added.iter().zip(&equations.diagonal))
            .map(|(added, diagonal)| *diagonal * damping + *added)
            .collect()
    };
    let upper: Vec<f64> = free.iter().map(|&i| from.upper(i)).collect();
    let step = match &equations.coupling {
        Coupling::Dense(hessian) => {
            dense_step(hessian, prior, &x, &descent, &upper, damping, &added)
        }
        Coupling::Sparse(slopes) => {
            let hessian = SparseHessian {
                slopes,
                diagonal: &equations.diagonal,
                prior,
            };
            hessian.bounded_step(&x, &descent, &added(damping), &upper)
        }
    };

    let mut proposal = from.clone();
    let mut length = StepLength::default();
    for (row, &i) in free.iter().enumerate() {
        let y = (x[row] + step[row]).clamp(DVec3::ZERO, DVec3::splat(upper[row]));
        // The marginal standard error is √scatter / curvature; changes below rounding do not count.
        let change = (y - x[row]).abs();
        let rounding = x[row] * ROUNDING;
        let relative = |curvature: DVec3| {
            let noise = equations.scatter[row].powf(0.5) / curvature + rounding;
            let counted = change.cmpgt(DVec3::ZERO) & curvature.cmpgt(DVec3::ZERO);
            DVec3::select(counted, change / noise, DVec3::ZERO).max_element()
        };
        let across = equations.signal(row);
        length.step = length.step.max(relative(across));
        length.remaining = length.remaining.max(relative(equations.diagonal[row]));
        *proposal.value_mut(i) = y.as_vec3();
    }
    (proposal, length)
}

/// The step of each channel, damped as far as needed to be solvable; zero if no damping helps.
fn dense_step(
    hessian: &[DMatrix<f64>; 3],
    prior: &PriorTerms,
    x: &[DVec3],
    descent: &[DVec3],
    upper: &[f64],
    damping: f64,
    added: &(dyn Fn(f64) -> Vec<DVec3> + Sync),
) -> Vec<DVec3> {
    per_channel(|channel| {
        let of = |all: &[DVec3]| -> Vec<f64> { all.iter().map(|v| v[channel]).collect() };
        let hessian = prior.couple(&hessian[channel], channel);
        let (x, descent) = (of(x), DVector::from_vec(of(descent)));
        let mut damping = damping;
        while damping < 1e9 {
            let step = Step {
                hessian: &hessian,
                descent: &descent,
                damping: DVector::from_vec(of(&added(damping))),
                upper,
            };
            if let Some(solution) = step.solve(&x) {
                return solution.as_slice().to_vec();
            }
            damping *= 10.0;
        }
        vec![0.0; x.len()]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::paths::clusters::Cluster;
    use crate::inverse::paths::evaluate::Linearised;
    use crate::inverse::paths::{CachedCluster, Vertex};
    use crate::inverse::roles::{self, Role};
    use crate::math::rng::Stream;
    use glam::Vec3;

    /// Noise-free photographs of a lamp and a wall. One set of paths overestimates the light, the other one underestimates it.
    fn opposed(index: usize) -> CachedCluster {
        let lamp = index.is_multiple_of(2);
        let off = [0.03, -0.03][index / 2 % 2];
        let vertex = |set: usize| Vertex {
            emission_weight: [1.0 + off, 1.0 - off][set],
            known: Vec3::splat([1.0 + off, 1.0 - off][set]),
            ..Vertex::on(u32::from(lamp))
        };
        let measured: f32 = if lamp { 17.3 } else { 0.37 };
        CachedCluster {
            cluster: Cluster {
                level: Some(Vec3::splat(measured)),
                dark: Vec3::ZERO,
                ..Cluster::unit(u32::from(lamp), 1, Vec3::splat(measured))
            },
            vertices: vec![vertex(0), vertex(1)],
            ends: vec![1, 2],
        }
    }

    /// A fit of at most thirty steps in which all clusters weigh alike.
    fn fitted(clusters: Vec<CachedCluster>, roles: &[Role], start: &Unknowns) -> Fit {
        let cache = PathCache::from(clusters);
        let (even, free) = (
            RobustWeights::even(roles.len()),
            roles::free(roles, |k| roles[k] != Role::Emitter),
        );
        let prior = Prior::new(roles.len(), roles.len(), Vec3::ONE);
        let between = |_: &NormalEquations| Ok::<_, ()>(());
        fit(&cache, start, &free, &even, &prior, 30, between).expect("nothing ends it")
    }

    /// 300 lamps of radiance 1, each in two clusters with paths so noisy that some curvatures across the sets are negative.
    #[test]
    fn unknowns_that_few_paths_know_do_not_run_away() {
        const LAMPS: usize = 300;
        let mut stream = Stream::new(73, 0, 0, 0);
        let clusters = (0..2 * LAMPS).map(|index| {
            let lamp = (index / 2) as u32;
            let mut vertex = || Vertex {
                emission_weight: 1.0 + 1.8 * (2.0 * stream.uniform() - 1.0),
                ..Vertex::on(lamp)
            };
            let vertices = vec![vertex(), vertex()];
            let mut cached = opposed(0);
            cached.cluster.object = lamp;
            cached.cluster.measured = Vec3::ONE;
            CachedCluster { vertices, ..cached }
        });
        let fitted = fitted(
            clusters.collect(),
            &[Role::Emitter; LAMPS],
            &Unknowns::new(LAMPS),
        );
        let mut found: Vec<f32> = fitted.unknowns.emission.iter().map(|e| e.x).collect();
        found.sort_by(f32::total_cmp);
        let [median, max] = [found[LAMPS / 2], found[LAMPS - 1]];
        assert!((0.5..1.5).contains(&median), "{median}");
        assert!(max < 10.0, "{max} after {} steps", fitted.iterations);
    }

    #[test]
    fn a_fit_ends_where_only_the_paths_are_noisy() {
        let start = Unknowns::grey([0.5, 0.0], [0.0; 2]);
        let clusters = (0..80).map(opposed).collect();
        let fitted = fitted(clusters, &[Role::Reflector, Role::Emitter], &start);
        assert!(fitted.equations.objective.max_element() < 0.0);
        assert!(fitted.iterations < 6, "{} steps", fitted.iterations);
        // Opposed noise of the two sets leaves an error of its square.
        let [albedo, emission] = [fitted.unknowns.albedo[0].x, fitted.unknowns.emission[1].x];
        assert!((albedo / 0.37 - 1.0).abs() < 2e-3, "{albedo}");
        assert!((emission / 17.3 - 1.0).abs() < 2e-3, "{emission}");
    }

    /// The residuals of the two sets have opposite signs, so that their product says nothing of the noise.
    #[test]
    fn noisy_paths_do_not_switch_the_prior_off() {
        let residuals = [DVec3::ONE, DVec3::splat(-0.2)];
        let noisy = Linearised {
            rows: vec![(0, DVec3::ONE, DVec3::ONE)],
            residuals,
            ..Linearised::unit(0, DVec3::ZERO)
        };
        let mut prior = Prior::new(1, 1, Vec3::ONE);
        prior.albedo.deviation[0] = Vec3::splat(0.01);
        let equations = NormalEquations::new(&[noisy], 1, &RobustWeights::even(1), &prior);
        assert!(equations.objective.max_element() < 0.0);
        let start = Unknowns::grey([0.5], [0.0]);
        let terms = PriorTerms::new(&equations, &[0], &start);
        let (next, _) = propose(&equations, &terms, &[0], &start, MIN_DAMPING);
        // One residual of 0.4, a half difference of 0.6 and a prior of 0.01, which weighs 60² times as much.
        let expected = 0.5 + 0.4 / (1.0 + 60.0 * 60.0);
        assert!((next.albedo[0] - expected).abs().max_element() < 1e-6);
    }
}
