//! Finds the zero of the unbiased descent direction within bounds, by Gauss–Newton steps.

use crate::inverse::fit::equations::{Coupling, Matrices, NormalEquations};
use crate::inverse::fit::errors::signal;
use crate::inverse::fit::prior::Prior;
use crate::inverse::fit::robust_weights::RobustWeights;
use crate::inverse::fit::rows::Bounded;
use crate::inverse::fit::step::Step;
use crate::inverse::paths::PathCache;
use crate::inverse::unknowns::Unknowns;
use glam::DVec3;
use nalgebra::DVector;

/// Damping relative to the diagonal; only keeps the factorisation safe from rounding.
pub const MIN_DAMPING: f64 = 1e-10;
/// A step below this many standard errors in every parameter ends the fit.
pub const STEP_TOLERANCE: f64 = 0.1;
/// A gradient within so many times its noise that keeps more than this fraction of itself over a step ends the fit as well.
const WITHIN_NOISE: f64 = 2.0;
const STALLED: f64 = 0.9;
/// Values that differ by a few units in the last place of single precision, over [`STEP_TOLERANCE`].
const ROUNDING: f64 = 4.0 * f32::EPSILON as f64 / STEP_TOLERANCE;

/// Where a fit ended.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The unknowns.
    pub unknowns: Unknowns,
    /// The normal equations there, over the parameters that were free.
    pub equations: NormalEquations,
    /// Steps taken.
    pub iterations: u64,
}

/// Weighted variance of one cluster's residual, without the noise of the paths.
pub fn noise(equations: &NormalEquations) -> DVec3 {
    (equations.objective / equations.clusters.max(1) as f64).max(DVec3::splat(1e-12))
}

/// Fits the free parameters (indices into albedos, then emissions). `between` hears of
/// the equations after every step, and may end the fit.
///
/// # Errors
/// What `between` returns.
pub fn fit<E>(
    cache: &PathCache,
    start: &Unknowns,
    free: &[usize],
    robust: &RobustWeights,
    prior: &Prior,
    max_steps: u64,
    mut between: impl FnMut(&NormalEquations) -> Result<(), E>,
) -> Result<Fit, E> {
    let mut unknowns = start.clone();
    let mut equations = cache.normal_equations(&unknowns, free, robust, prior);
    let mut iterations = 0;
    let mut damping = MIN_DAMPING;
    let mut before = f64::INFINITY;
    while iterations < max_steps {
        let pull = pull(&equations, free, &unknowns);
        if is_stalled(before, pull) {
            break;
        }
        let (proposal, length) = propose(&equations, free, &unknowns, damping);
        let after = cache.normal_equations(&proposal, free, robust, prior);
        iterations += 1;
        between(&after)?;
        // A step from afar may overshoot: the squared error then tells.
        if worse(&equations, &after) && damping < 1e3 {
            damping = (damping * 100.0).max(1e-3);
            continue;
        }
        damping = (damping * 0.01).max(MIN_DAMPING);
        (unknowns, equations, before) = (proposal, after, pull);
        if length.step < STEP_TOLERANCE {
            break;
        }
    }
    Ok(Fit {
        unknowns,
        equations,
        iterations,
    })
}

/// Whether the squared error of any channel clearly rose.
fn worse(before: &NormalEquations, after: &NormalEquations) -> bool {
    let size = |o: DVec3| o.abs();
    let rise = after.objective - before.objective;
    !after.objective.is_finite() || rise.cmpgt(size(before.objective) * 0.5).any()
}

/// Whether nothing but noise is left to follow, given [`pull`] before a step and after it. Where many unknowns share few
/// paths, further steps would follow the noise of the paths without end: across two sets it may say that the squared error
/// falls the faster the farther one goes.
pub fn is_stalled(before: f64, after: f64) -> bool {
    after < WITHIN_NOISE && after > STALLED * before
}

/// The squared gradient over what its noise makes of it, both over the curvature and summed over parameters; of those at
/// their bounds only where it leads inwards. One where nothing but noise is left.
pub fn pull(equations: &NormalEquations, free: &[usize], at: &Unknowns) -> f64 {
    let (mut pull, mut expected) = (0.0, 0.0);
    let gradients = gradients(equations, free, at).into_iter();
    for (row, (gradient, &i)) in gradients.zip(free).enumerate() {
        let (x, upper) = (at.value(i).as_dvec3(), upper(i, at));
        let curvature = equations.diagonal[row];
        for channel in 0..3 {
            let [x, g, h] = [x, gradient, curvature].map(|v| v[channel]);
            let held = (x <= 0.0 && g < 0.0) || (x >= upper && g > 0.0);
            if h > 0.0 && !held {
                pull += g * g / h;
                expected += equations.scatter[row][channel] / h;
            }
        }
    }
    if expected > 0.0 { pull / expected } else { 0.0 }
}

/// The direction of descent of each free parameter, what is believed besides pulling like measurements.
fn gradients(equations: &NormalEquations, free: &[usize], at: &Unknowns) -> Vec<DVec3> {
    let variance = noise(equations);
    let pulled = |(descent, &i): (&DVec3, &usize)| {
        let (mean, precision) = equations.prior.of(i, variance);
        *descent + precision * (mean - at.value(i).as_dvec3())
    };
    equations.descent.iter().zip(free).map(pulled).collect()
}

/// The largest value of a parameter: no albedo exceeds one.
fn upper(index: usize, unknowns: &Unknowns) -> f64 {
    if index < unknowns.surfaces() {
        1.0
    } else {
        f64::INFINITY
    }
}

/// How far a step goes: its largest component, in standard errors of the parameters.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Length {
    /// Of the step itself.
    pub step: f64,
    /// Of all steps to come, if they go on like this one: noise in the derivatives makes each too short, and the more so the
    /// less is known.
    pub left: f64,
}

/// Unknowns after one step, and its length.
pub fn propose(
    equations: &NormalEquations,
    free: &[usize],
    from: &Unknowns,
    damping: f64,
) -> (Unknowns, Length) {
    let x: Vec<DVec3> = free.iter().map(|&i| from.value(i).as_dvec3()).collect();
    let variance = noise(equations);
    let descent = gradients(equations, free, from);
    // What no path touches stays where it is.
    let added = |damping: f64| -> Vec<DVec3> {
        let diagonals = free.iter().zip(&equations.diagonal);
        (diagonals.map(|(&i, diagonal)| {
            let untouched = DVec3::select(diagonal.cmpgt(DVec3::ZERO), DVec3::ZERO, DVec3::ONE);
            *diagonal * damping + equations.prior.of(i, variance).1 + untouched
        }))
        .collect()
    };
    let upper: Vec<f64> = free.iter().map(|&i| upper(i, from)).collect();
    let step = match &equations.coupling {
        Coupling::Dense(matrices) => dense_step(matrices, &x, &descent, &upper, damping, &added),
        Coupling::Sparse(rows) => rows.bounded_step(&Bounded {
            x: &x,
            descent: &descent,
            added: &added(damping),
            upper: &upper,
        }),
    };

    let mut proposal = from.clone();
    let mut length = Length::default();
    for (row, &i) in free.iter().enumerate() {
        let y = (x[row] + step[row]).clamp(DVec3::ZERO, DVec3::splat(upper[row]));
        // By itself a parameter has the standard error √scatter / across; values cannot be told apart below their rounding.
        let moved = (y - x[row]).abs();
        let rounding = x[row] * ROUNDING;
        let of = |curvature: DVec3| {
            let noise = equations.scatter[row].powf(0.5) / curvature + rounding;
            let counted = moved.cmpgt(DVec3::ZERO) & curvature.cmpgt(DVec3::ZERO);
            DVec3::select(counted, moved / noise, DVec3::ZERO).max_element()
        };
        let across = signal(equations.diagonal[row], equations.across[row]);
        length.step = length.step.max(of(across));
        length.left = length.left.max(of(equations.diagonal[row]));
        *proposal.value_mut(i) = y.as_vec3();
    }
    (proposal, length)
}

/// The step of each channel by itself, damped as far as its equations must be; none where no damping helps.
fn dense_step(
    matrices: &Matrices,
    x: &[DVec3],
    descent: &[DVec3],
    upper: &[f64],
    damping: f64,
    added: &dyn Fn(f64) -> Vec<DVec3>,
) -> Vec<DVec3> {
    let mut steps = vec![DVec3::ZERO; x.len()];
    let lower = vec![0.0; x.len()];
    for channel in 0..3 {
        let of = |all: &[DVec3]| -> Vec<f64> { all.iter().map(|v| v[channel]).collect() };
        let descent = DVector::from_vec(of(descent));
        let mut damping = damping;
        while damping < 1e9 {
            let step = Step {
                hessian: &matrices.hessian[channel],
                descent: &descent,
                damping: DVector::from_vec(of(&added(damping))),
                lower: &lower,
                upper,
            };
            if let Some(found) = step.solve(&of(x)) {
                (steps.iter_mut().zip(found.iter())).for_each(|(s, d)| s[channel] = *d);
                break;
            }
            damping *= 10.0;
        }
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::paths::CachedCluster;
    use crate::inverse::paths::Vertex;
    use crate::inverse::paths::clusters::Cluster;
    use crate::inverse::roles;
    use crate::inverse::roles::Role;
    use crate::math::rng::Stream;
    use glam::{BVec3, Vec3};

    /// Photographs without noise of a lamp and of a wall, of which one set of paths says too much light and the other too
    /// little, so that the product of their residuals is negative.
    fn opposed(index: usize) -> CachedCluster {
        let lamp = index.is_multiple_of(2);
        let off = [0.03, -0.03][index / 2 % 2];
        let vertex = |set: usize| Vertex {
            emission_weight: [1.0 + off, 1.0 - off][set],
            known: Vec3::splat([1.0 + off, 1.0 - off][set]),
            ..Vertex::on(u32::from(lamp))
        };
        let measured = if lamp { 17.3 } else { 0.37 };
        CachedCluster {
            cluster: Cluster {
                frame: 0,
                object: u32::from(lamp),
                pixels: vec![0],
                paths: 1,
                measured: Vec3::splat(measured),
                censored: BVec3::FALSE,
                weight: Vec3::splat(measured.powi(-2)),
                dark: Vec3::ONE,
            },
            vertices: vec![vertex(0), vertex(1)],
            ends: vec![1, 2],
        }
    }

    /// A fit of at most thirty steps in which all clusters weigh alike.
    fn fitted(clusters: Vec<CachedCluster>, roles: &[Role], start: &Unknowns) -> Fit {
        let cache = PathCache {
            clusters,
            ..PathCache::default()
        };
        let (even, free) = (
            RobustWeights::even(roles.len()),
            roles::free(roles, |k| roles[k] != Role::Emitter),
        );
        let prior = Prior::new(roles.len(), roles.len(), Vec3::ONE);
        let between = |_: &NormalEquations| Ok::<_, ()>(());
        fit(&cache, start, &free, &even, &prior, 30, between).expect("nothing ends it")
    }

    /// Three hundred lamps of radiance 1, each known by two clusters whose paths are so noisy that their product across the
    /// sets is negative for some: these would grow with every step.
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
            cached.cluster.weight = Vec3::ONE;
            CachedCluster { vertices, ..cached }
        });
        let fitted = fitted(
            clusters.collect(),
            &[Role::Emitter; LAMPS],
            &Unknowns::new(LAMPS),
        );
        let mut found: Vec<f32> = fitted.unknowns.emission.iter().map(|e| e.x).collect();
        found.sort_by(f32::total_cmp);
        let [median, most] = [found[LAMPS / 2], found[LAMPS - 1]];
        assert!((0.5..1.5).contains(&median), "{median}");
        assert!(most < 10.0, "{most} after {} steps", fitted.iterations);
    }

    #[test]
    fn a_fit_ends_where_only_the_paths_are_noisy() {
        let mut start = Unknowns::new(2);
        start.albedo[1] = Vec3::ZERO;
        let clusters = (0..80).map(opposed).collect();
        let fitted = fitted(clusters, &[Role::Reflector, Role::Emitter], &start);
        assert!(fitted.equations.objective.max_element() < 0.0);
        assert!(fitted.iterations < 6, "{} steps", fitted.iterations);
        // Two sets whose noise is opposed are off by its square.
        let [albedo, emission] = [fitted.unknowns.albedo[0].x, fitted.unknowns.emission[1].x];
        assert!((albedo / 0.37 - 1.0).abs() < 2e-3, "{albedo}");
        assert!((emission / 17.3 - 1.0).abs() < 2e-3, "{emission}");
    }
}
