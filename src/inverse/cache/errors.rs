//! How sure a fit is: standard errors of what was fitted, and tests of what was left out.

use super::evaluate::NormalEquations;
use super::fit::noise;
use super::prior::ALBEDO_DEVIATION;
use glam::Vec3;
use nalgebra::{Cholesky, DMatrix, DVector};

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
}

impl Released {
    /// χ² of three degrees of freedom over the channels that would rise.
    pub fn significance(&self) -> f64 {
        (0..3)
            .filter(|&c| self.step[c] > 0.0 && self.stderr[c] > 0.0)
            .map(|c| (self.step[c] / self.stderr[c]).powi(2))
            .sum()
    }
}

/// Inverse of the free block of one channel's Hessian with the prior, damped where it must be.
fn inverse(
    equations: &NormalEquations,
    rows: &[usize],
    prior: &[f64],
    channel: usize,
) -> Option<DMatrix<f64>> {
    let hessian = &equations.hessian[channel];
    let n = rows.len();
    let mut damping = 0.0;
    while damping < 1e6 {
        let matrix = DMatrix::from_fn(n, n, |a, b| {
            let (i, j) = (rows[a].max(rows[b]), rows[a].min(rows[b]));
            let diagonal = hessian[(i, i)];
            let added = if diagonal > 0.0 {
                damping * diagonal
            } else {
                1.0
            };
            hessian[(i, j)] + if a == b { prior[a] + added } else { 0.0 }
        });
        if let Some(cholesky) = Cholesky::new(matrix) {
            return Some(cholesky.inverse());
        }
        damping = (damping * 10.0).max(1e-9);
    }
    None
}

/// Standard errors of the parameters at `rows` of `free`, the others held: the sandwich (H + P)⁻¹ (S + vP) (H + P)⁻¹
/// with S the scatter of the clusters' scores, so that noise of photographs and of paths both count, whatever their
/// distribution (Huber 1967).
pub fn standard_errors(
    equations: &NormalEquations,
    free: &[usize],
    rows: &[usize],
    objects: usize,
) -> StandardErrors {
    let mut errors = StandardErrors {
        albedo: vec![Vec3::splat(ALBEDO_DEVIATION as f32); objects],
        emission: vec![Vec3::INFINITY; objects],
    };
    for channel in 0..3 {
        let variance = noise(equations, channel);
        let prior: Vec<f64> = rows
            .iter()
            .map(|&r| equations.prior.of(free[r], channel, variance).1)
            .collect();
        let Some(bread) = inverse(equations, rows, &prior, channel) else {
            continue;
        };
        let scatter = &equations.scatter[channel];
        let meat = DMatrix::from_fn(rows.len(), rows.len(), |a, b| {
            let (i, j) = (rows[a].max(rows[b]), rows[a].min(rows[b]));
            scatter[(i, j)] + if a == b { variance * prior[a] } else { 0.0 }
        });
        let covariance = &bread * meat * &bread;
        for (a, &row) in rows.iter().enumerate() {
            let index = free[row];
            let error = covariance[(a, a)].max(0.0).sqrt() as f32;
            let known = equations.hessian[channel][(row, row)] > 0.0;
            match (known, index.checked_sub(objects)) {
                (true, None) => errors.albedo[index][channel] = error,
                (true, Some(emitter)) => errors.emission[emitter][channel] = error,
                (false, _) => {}
            }
        }
    }
    errors
}

/// For each row of `free` that is not in `active`: the step it would take if it alone were set free besides the
/// active ones, with its standard error (a score test, Rao 1948).
pub fn release(equations: &NormalEquations, free: &[usize], active: &[usize]) -> Vec<Released> {
    let held: Vec<usize> = (0..free.len()).filter(|r| !active.contains(r)).collect();
    let mut released: Vec<Released> = held
        .iter()
        .map(|&r| Released {
            index: free[r],
            step: [0.0; 3],
            stderr: [f64::INFINITY; 3],
        })
        .collect();
    for channel in 0..3 {
        let variance = noise(equations, channel);
        let prior: Vec<f64> = active
            .iter()
            .map(|&r| equations.prior.of(free[r], channel, variance).1)
            .collect();
        let Some(inverse) = inverse(equations, active, &prior, channel) else {
            continue;
        };
        let (hessian, scatter) = (&equations.hessian[channel], &equations.scatter[channel]);
        let block = |m: &DMatrix<f64>, row: usize| {
            DVector::from_fn(active.len(), |a, _| {
                m[(row.max(active[a]), row.min(active[a]))]
            })
        };
        let active_scatter = DMatrix::from_fn(active.len(), active.len(), |a, b| {
            scatter[(active[a].max(active[b]), active[a].min(active[b]))]
        });
        for (&row, result) in held.iter().zip(&mut released) {
            let coupling = block(hessian, row);
            let u = &inverse * &coupling;
            let curvature = hessian[(row, row)] - coupling.dot(&u);
            if curvature <= 1e-9 * hessian[(row, row)] || hessian[(row, row)] <= 0.0 {
                continue;
            }
            let own = scatter[(row, row)];
            let score_variance =
                own - 2.0 * u.dot(&block(scatter, row)) + u.dot(&(&active_scatter * &u));
            result.step[channel] = equations.descent[channel][row] / curvature;
            result.stderr[channel] = score_variance.max(0.0).sqrt() / curvature;
        }
    }
    released
}
