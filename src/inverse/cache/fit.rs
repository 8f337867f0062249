//! Finds the zero of the unbiased descent direction within bounds, by Gauss–Newton steps.

use super::PathCache;
use super::equations::{Coupling, Matrices, NormalEquations};
use super::prior::Prior;
use super::rows::Bounded;
use super::step::Step;
use super::trust::Trust;
use crate::inverse::parameters::Unknowns;
use glam::DVec3;
use nalgebra::DVector;

/// Damping relative to the diagonal; only keeps the factorisation safe from rounding.
pub const LEAST_DAMPING: f64 = 1e-10;
/// A step below this many standard errors in every parameter ends the fit.
pub const STEP_TOLERANCE: f64 = 0.1;

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

/// Fits the free parameters (indices into albedos, then emissions). `between` runs after every step and may end it.
pub fn fit<E>(
    cache: &PathCache,
    start: &Unknowns,
    free: &[usize],
    trust: &Trust,
    prior: &Prior,
    most_steps: u64,
    mut between: impl FnMut(&Unknowns) -> Result<(), E>,
) -> Result<Fit, E> {
    let mut unknowns = start.clone();
    let mut equations = cache.normal_equations(&unknowns, free, trust, prior);
    let mut iterations = 0;
    let mut damping = LEAST_DAMPING;
    while iterations < most_steps {
        let (proposal, largest) = propose(&equations, free, &unknowns, damping);
        let after = cache.normal_equations(&proposal, free, trust, prior);
        iterations += 1;
        between(&proposal)?;
        // A step from afar may overshoot: the squared error then tells.
        if worse(&equations, &after) && damping < 1e3 {
            damping = (damping * 100.0).max(1e-3);
            continue;
        }
        damping = (damping * 0.01).max(LEAST_DAMPING);
        (unknowns, equations) = (proposal, after);
        if largest < STEP_TOLERANCE {
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

/// Unknowns after one step, and its largest component in standard errors.
pub fn propose(
    equations: &NormalEquations,
    free: &[usize],
    from: &Unknowns,
    damping: f64,
) -> (Unknowns, f64) {
    // What is believed besides pulls like measurements; what no path touches stays where it is.
    let x: Vec<DVec3> = free.iter().map(|&i| from.value(i).as_dvec3()).collect();
    let variance = noise(equations);
    let mut descent = equations.descent.clone();
    let added = |damping: f64| -> Vec<DVec3> {
        let diagonals = free.iter().zip(&equations.diagonal);
        (diagonals.map(|(&i, diagonal)| {
            let untouched = DVec3::select(diagonal.cmpgt(DVec3::ZERO), DVec3::ZERO, DVec3::ONE);
            *diagonal * damping + equations.prior.of(i, variance).1 + untouched
        }))
        .collect()
    };
    for ((g, &i), x) in descent.iter_mut().zip(free).zip(&x) {
        let (mean, precision) = equations.prior.of(i, variance);
        *g += precision * (mean - *x);
    }
    let surfaces = from.surfaces();
    let upper: Vec<f64> = (free.iter())
        .map(|&i| if i < surfaces { 1.0 } else { f64::INFINITY })
        .collect();
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
    let mut largest = 0.0f64;
    for (row, &i) in free.iter().enumerate() {
        let y = (x[row] + step[row]).clamp(DVec3::ZERO, DVec3::splat(upper[row]));
        let information = equations.diagonal[row] / variance;
        largest = largest.max(((x[row] - y).abs() * information.powf(0.5)).max_element());
        *proposal.value_mut(i) = y.as_vec3();
    }
    (proposal, largest)
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
