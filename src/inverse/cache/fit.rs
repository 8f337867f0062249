//! Finds the zero of the unbiased descent direction within bounds, by Gauss–Newton steps.

use super::PathCache;
use super::evaluate::NormalEquations;
use super::prior::Prior;
use super::step::Step;
use super::trust::Trust;
use crate::inverse::parameters::Unknowns;
use glam::DVec3;
use nalgebra::DVector;

/// Damping relative to the diagonal; only keeps the factorisation safe from rounding.
pub const LEAST_DAMPING: f64 = 1e-10;
/// A step below this many standard errors in every parameter ends the fit.
const STEP_TOLERANCE: f64 = 0.02;

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

/// Reads the free parameters of one channel.
pub fn gather(unknowns: &Unknowns, free: &[usize], channel: usize) -> Vec<f64> {
    free.iter()
        .map(|&i| f64::from(unknowns.value(i)[channel]))
        .collect()
}

/// Writes the free parameters of one channel.
pub fn scatter(unknowns: &mut Unknowns, free: &[usize], channel: usize, values: &[f64]) {
    for (&i, &value) in free.iter().zip(values) {
        unknowns.value_mut(i)[channel] = value as f32;
    }
}

/// Weighted variance of one cluster's residual, without the noise of the paths.
pub fn noise(equations: &NormalEquations, channel: usize) -> f64 {
    (equations.objective[channel] / equations.clusters.max(1) as f64).max(1e-12)
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
    let mut proposal = from.clone();
    let mut largest = 0.0f64;
    for channel in 0..3 {
        let x = gather(from, free, channel);
        let Some(y) = propose_channel(equations, free, from.surfaces(), channel, &x, damping)
        else {
            continue;
        };
        let variance = noise(equations, channel);
        for (i, (x, y)) in x.iter().zip(&y).enumerate() {
            let information = equations.hessian[channel][(i, i)] / variance;
            largest = largest.max((x - y).abs() * information.sqrt());
        }
        scatter(&mut proposal, free, channel, &y);
    }
    (proposal, largest)
}

/// New values of one channel's free parameters; `None` if no damping makes the equations definite.
fn propose_channel(
    equations: &NormalEquations,
    free: &[usize],
    objects: usize,
    channel: usize,
    x: &[f64],
    mut damping: f64,
) -> Option<Vec<f64>> {
    let variance = noise(equations, channel);
    let hessian = &equations.hessian[channel];
    let (mean, prior): (Vec<f64>, Vec<f64>) = (free.iter())
        .map(|&i| equations.prior.of(i, channel, variance))
        .unzip();
    let descent = DVector::from_fn(x.len(), |i, _| {
        equations.descent[channel][i] + prior[i] * (mean[i] - x[i])
    });
    let lower = vec![0.0; x.len()];
    let upper: Vec<f64> = free
        .iter()
        .map(|&i| if i < objects { 1.0 } else { f64::INFINITY })
        .collect();
    while damping < 1e9 {
        // What no path touches stays where it is.
        let added = DVector::from_fn(x.len(), |i, _| {
            let diagonal = hessian[(i, i)];
            damping * diagonal + prior[i] + if diagonal > 0.0 { 0.0 } else { 1.0 }
        });
        let step = Step {
            hessian,
            descent: &descent,
            damping: added,
            lower: &lower,
            upper: &upper,
        };
        if let Some(d) = step.solve(x) {
            let bounded = |i: usize| (x[i] + d[i]).clamp(lower[i], upper[i]);
            return Some((0..x.len()).map(bounded).collect());
        }
        damping *= 10.0;
    }
    None
}
