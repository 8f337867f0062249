//! The prior's terms in the normal equations of one set of free parameters.

use crate::inverse::fit::equations::{Coupling, NormalEquations};
use crate::inverse::fit::sky_prior::{Information, Normal};
use crate::inverse::unknowns::Unknowns;
use crate::math::cholesky;
use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use std::borrow::Cow;

/// The prior of the free parameters, in the units of the normal equations: precisions are times the variance of a cluster.
#[derive(Debug, Clone)]
pub struct PriorTerms {
    /// Mean of each parameter.
    pub mean: Vec<DVec3>,
    /// Diagonal of the precision.
    pub precision: Vec<DVec3>,
    /// Terms added to the diagonal: the precision, and one for parameters that neither a path nor the prior knows.
    pub added: Vec<DVec3>,
    /// [`NormalEquations::prior_variance`] of each parameter.
    pub variance: Vec<DVec3>,
    /// Standard deviation of each parameter; infinite without a prior.
    pub deviation: Vec<DVec3>,
    /// The correlated part.
    pub block: Option<Block>,
}

/// The precision of correlated parameters.
#[derive(Debug, Clone)]
pub struct Block {
    /// Their rows among the free parameters.
    pub rows: Vec<usize>,
    /// The off-diagonal entries; the diagonal is zero.
    pub couplings: [DMatrix<f64>; 3],
}

impl PriorTerms {
    /// The terms of the parameters in `free`, with the values `at`.
    pub fn new(equations: &NormalEquations, free: &[usize], at: &Unknowns) -> Self {
        let rows = 0..free.len();
        let variance: Vec<DVec3> = rows.map(|row| equations.prior_variance(row)).collect();
        let of = |(&i, &variance): (&usize, &DVec3)| equations.prior.of(i, variance);
        let (mean, precision): (Vec<DVec3>, Vec<DVec3>) =
            free.iter().zip(&variance).map(of).unzip();
        let deviation = (precision.iter().zip(&variance))
            .map(|(precision, variance)| {
                let known = precision.cmpgt(DVec3::ZERO);
                DVec3::select(known, (variance / precision).powf(0.5), DVec3::INFINITY)
            })
            .collect();
        let mut terms = Self {
            mean,
            precision,
            added: Vec::new(),
            variance,
            deviation,
            block: None,
        };
        terms.correlate(equations, free, at);
        terms.added = (terms.precision.iter().zip(&equations.diagonal))
            .map(|(precision, diagonal)| {
                let met = diagonal.cmpgt(DVec3::ZERO) | precision.cmpgt(DVec3::ZERO);
                precision + DVec3::select(met, DVec3::ZERO, DVec3::ONE)
            })
            .collect();
        terms
    }

    /// Sets the prior of sky directions, given what the pixels say of them in all channels. Without a joint distribution, or if
    /// rounding leaves a matrix of it indefinite, each direction keeps its own prior.
    fn correlate(
        &mut self,
        equations: &NormalEquations,
        free: &[usize],
        at: &Unknowns,
    ) -> Option<()> {
        let (sky, first) = equations.prior.sky()?;
        let end = first + sky.radiance.len();
        let is_sky = |row: &usize| (first..end).contains(&free[*row]);
        let rows: Vec<usize> = (0..free.len()).filter(is_sky).collect();
        if rows.is_empty() {
            return None;
        }
        let directions: Vec<usize> = rows.iter().map(|row| free[*row] - first).collect();
        let information = [0, 1, 2].map(|c| self.information(equations, free, at, &rows, c));
        let channels = sky.channels(&directions, &information)?;
        for (i, &row) in rows.iter().enumerate() {
            let of = |value: &dyn Fn(&Normal) -> f64| {
                DVec3::from_array([0, 1, 2].map(|c| value(&channels[c])))
            };
            self.mean[row] = of(&|n| n.mean[i]);
            self.precision[row] = self.variance[row] * of(&|n| n.precision[(i, i)]);
            self.deviation[row] = of(&|n| n.variance[i].sqrt());
        }
        let roots: Vec<DVec3> = rows
            .iter()
            .map(|row| self.variance[*row].powf(0.5))
            .collect();
        let coupling = |channel: usize| {
            DMatrix::from_fn(rows.len(), rows.len(), |i, j| {
                let scale = roots[i][channel] * roots[j][channel];
                if i == j {
                    0.0
                } else {
                    scale * channels[channel].precision[(i, j)]
                }
            })
        };
        self.block = Some(Block {
            couplings: [coupling(0), coupling(1), coupling(2)],
            rows,
        });
        Some(())
    }

    /// What one channel's pixels say of the radiance of the sky directions in `rows`, with the other parameters eliminated. Those
    /// at a bound stay there.
    fn information(
        &self,
        equations: &NormalEquations,
        free: &[usize],
        at: &Unknowns,
        rows: &[usize],
        channel: usize,
    ) -> Information {
        let value = |row: usize| at.value(free[row]).as_dvec3();
        let gradient = |row: usize| {
            let prior = self.precision[row] * (self.mean[row] - value(row));
            (equations.descent[row] + prior)[channel]
        };
        let scale: Vec<f64> = rows
            .iter()
            .map(|r| self.variance[*r][channel].sqrt())
            .collect();
        let mut slope = DVector::from_iterator(
            rows.len(),
            rows.iter().map(|row| equations.descent[*row][channel]),
        );
        let mut curvature = DMatrix::from_diagonal(&DVector::from_iterator(
            rows.len(),
            rows.iter().map(|row| equations.diagonal[*row][channel]),
        ));
        if let Coupling::Dense(hessian) = &equations.coupling {
            let hessian = &hessian[channel];
            let entry = |i: usize, j: usize| hessian[(i.max(j), i.min(j))];
            let others: Vec<usize> = (0..free.len())
                .filter(|row| rows.binary_search(row).is_err())
                .filter(|&row| {
                    let held = at.is_held(free[row], channel, gradient(row));
                    !held && equations.diagonal[row][channel] > 0.0
                })
                .collect();
            let own = DMatrix::from_fn(others.len(), others.len(), |a, b| {
                let added = self.precision[others[a]][channel];
                entry(others[a], others[b]) + if a == b { added } else { 0.0 }
            });
            curvature = DMatrix::from_fn(rows.len(), rows.len(), |i, j| entry(rows[i], rows[j]));
            if let Some(factor) = cholesky::factor(own) {
                let cross =
                    DMatrix::from_fn(others.len(), rows.len(), |a, i| entry(others[a], rows[i]));
                let gradients =
                    DVector::from_iterator(others.len(), others.iter().map(|row| gradient(*row)));
                slope -= cross.tr_mul(&factor.solve(&gradients));
                curvature -= cross.tr_mul(&factor.solve(&cross));
            }
        }
        // Relative to the variances of clusters, and from zero instead of from the present radiance.
        for i in 0..rows.len() {
            slope[i] /= scale[i] * scale[i];
            for j in 0..rows.len() {
                curvature[(i, j)] /= scale[i] * scale[j];
            }
        }
        let present = DVector::from_iterator(rows.len(), rows.iter().map(|r| value(*r)[channel]));
        slope += &curvature * present;
        Information { curvature, slope }
    }

    /// Minus half the prior's gradient at values of the free parameters.
    pub fn pull(&self, values: &[DVec3]) -> Vec<DVec3> {
        let off: Vec<DVec3> = (self.mean.iter().zip(values))
            .map(|(m, x)| *m - *x)
            .collect();
        let mut pull: Vec<DVec3> = (self.precision.iter().zip(&off))
            .map(|(p, d)| *p * *d)
            .collect();
        self.add_coupled(&off, &mut pull);
        pull
    }

    /// Adds the off-diagonal part of the precision times a vector.
    pub fn add_coupled(&self, vector: &[DVec3], sum: &mut [DVec3]) {
        if let Some(block) = &self.block {
            for (i, &row) in block.rows.iter().enumerate() {
                for (j, &other) in block.rows.iter().enumerate() {
                    let entry = block.couplings.each_ref().map(|matrix| matrix[(i, j)]);
                    sum[row] += DVec3::from_array(entry) * vector[other];
                }
            }
        }
    }

    /// Cholesky factors of the covariance of the correlated parameters' scores.
    pub fn roots(&self) -> Option<[DMatrix<f64>; 3]> {
        let block = self.block.as_ref()?;
        let root = |channel: usize| {
            let n = block.rows.len();
            let matrix = DMatrix::from_fn(n, n, |i, j| {
                let [a, b] = [block.rows[i], block.rows[j]];
                let scale = (self.variance[a] * self.variance[b])[channel].sqrt();
                let own = if i == j {
                    self.precision[a][channel]
                } else {
                    0.0
                };
                scale * (block.couplings[channel][(i, j)] + own)
            });
            Some(cholesky::factor(matrix)?.l())
        };
        Some([root(0)?, root(1)?, root(2)?])
    }

    /// A draw of the prior's scores, with the [`Self::roots`] and a random sign of each parameter.
    pub fn scores(&self, roots: &Option<[DMatrix<f64>; 3]>, signs: &[DVec3]) -> Vec<DVec3> {
        let terms = self.variance.iter().zip(&self.precision).zip(signs);
        let mut scores: Vec<DVec3> = terms
            .map(|((v, p), sign)| (v * p).powf(0.5) * sign)
            .collect();
        if let (Some(block), Some(roots)) = (&self.block, roots) {
            for (i, &row) in block.rows.iter().enumerate() {
                scores[row] = (block.rows[..=i].iter().enumerate())
                    .map(|(j, &other)| {
                        let entry = roots.each_ref().map(|root| root[(i, j)]);
                        DVec3::from_array(entry) * signs[other]
                    })
                    .sum();
            }
        }
        scores
    }

    /// The Hessian of one channel with the off-diagonal entries of the precision added. Only the lower triangle is set.
    pub fn couple<'a>(&self, hessian: &'a DMatrix<f64>, channel: usize) -> Cow<'a, DMatrix<f64>> {
        let mut hessian = Cow::Borrowed(hessian);
        for (row, column, value) in self.couplings(channel) {
            hessian.to_mut()[(row, column)] += value;
        }
        hessian
    }

    /// The off-diagonal entries of the precision of one channel, as rows, columns and values of the lower triangle.
    pub fn couplings(&self, channel: usize) -> impl Iterator<Item = (usize, usize, f64)> {
        self.block.iter().flat_map(move |block| {
            let rows = block.rows.iter().enumerate();
            rows.flat_map(move |(i, &row)| {
                let before = block.rows[..i].iter().enumerate();
                before.map(move |(j, &column)| (row, column, block.couplings[channel][(i, j)]))
            })
        })
    }
}
