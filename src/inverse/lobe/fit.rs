//! Least-squares fit of an object's observations by a diffuse surface, or by a lobe of given roughness over a diffuse base.
//!
//! With u = albedo (1 − specular), an observation has the radiance u·base + specular·(lobe − grazing) + grazing, linear in u
//! and specular; roughness is searched outside (variable projection, Golub and Pereyra 1973). Products are taken across two
//! independent sets of paths, so that path noise causes no bias. The mean over the observations of a spot may be texture: it is
//! a random effect, down-weighted by the variance between spots (Fuller and Battese 1973).

use crate::inverse::lobe::gather::Components;
use glam::DVec3;
use nalgebra::{DMatrix, DVector};

/// One observation of the fit. All radiances are relative to the level of its spot.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// Index of its spot; rows of a spot are adjacent.
    pub spot: usize,
    /// Number of pixels.
    pub weight: f64,
    pub measured: DVec3,
    /// An absolute radiance of one.
    pub one: DVec3,
    /// Radiance of each component per unit, from two independent sets of paths.
    pub sets: [Components; 2],
}

/// A model of the rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Model {
    /// A diffuse surface. Parameters: RGB albedo, and RGB emission if it may emit.
    Diffuse { emits: bool },
    /// A lobe over a diffuse base. Parameters: RGB albedo × (1 − specular), and specular.
    Lobe,
}

/// Variances of a model's residuals for one pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variances {
    /// Between observations of a spot.
    pub within: f64,
    /// Between spots, in addition.
    pub between: f64,
}

impl Model {
    pub fn len(self) -> usize {
        match self {
            Self::Diffuse { emits: false } => 3,
            Self::Lobe => 4,
            Self::Diffuse { emits: true } => 6,
        }
    }

    /// The derivatives of one channel of a row: parameter and derivative.
    fn slopes(self, row: &Row, set: usize, channel: usize) -> [(usize, f64); 2] {
        let components = &row.sets[set];
        match self {
            Self::Diffuse { emits } => [
                (channel, components.diffuse[channel]),
                if emits {
                    (3 + channel, row.one[channel])
                } else {
                    (channel, 0.0)
                },
            ],
            Self::Lobe => [
                (channel, components.base[channel]),
                (3, components.lobe[channel] - components.grazing[channel]),
            ],
        }
    }

    /// Radiance of one channel of a row with all parameters at zero.
    fn offset(self, row: &Row, set: usize, channel: usize) -> f64 {
        match self {
            Self::Diffuse { .. } => 0.0,
            Self::Lobe => row.sets[set].grazing[channel],
        }
    }

    /// Photograph minus model, for both sets.
    pub fn residuals(self, row: &Row, parameters: &[f64]) -> [DVec3; 2] {
        [0, 1].map(|set| {
            DVec3::from_array(std::array::from_fn(|c| {
                let slopes = self.slopes(row, set, c);
                let model: f64 = slopes.iter().map(|&(i, s)| s * parameters[i]).sum();
                row.measured[c] - self.offset(row, set, c) - model
            }))
        })
    }

    /// Squared error Σ w r_A r_B.
    pub fn error(self, rows: &[Row], parameters: &[f64]) -> f64 {
        (rows.iter())
            .map(|row| {
                let [a, b] = self.residuals(row, parameters);
                row.weight * a.dot(b)
            })
            .sum()
    }

    /// The least-squares parameters within their bounds; `None` if the rows do not determine them.
    pub fn fit(self, rows: &[Row]) -> Option<Vec<f64>> {
        let n = self.len();
        let (mut normal, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for row in rows {
            for c in 0..3 {
                let slopes = [0, 1].map(|set| self.slopes(row, set, c));
                let target = [0, 1].map(|set| row.measured[c] - self.offset(row, set, c));
                for (set, other) in [(0, 1), (1, 0)] {
                    for (i, s) in slopes[set] {
                        right[i] += 0.5 * row.weight * s * target[other];
                        for (j, t) in slopes[other] {
                            normal[(i, j)] += 0.5 * row.weight * s * t;
                        }
                    }
                }
            }
        }
        self.bounded(&normal, &right)
    }

    /// Solves the normal equations; parameters that leave their bounds are held there.
    fn bounded(self, normal: &DMatrix<f64>, right: &DVector<f64>) -> Option<Vec<f64>> {
        let n = self.len();
        let mut held: Vec<Option<f64>> = vec![None; n];
        loop {
            let free: Vec<usize> = (0..n).filter(|&i| held[i].is_none()).collect();
            let matrix =
                DMatrix::from_fn(free.len(), free.len(), |a, b| normal[(free[a], free[b])]);
            let vector = DVector::from_fn(free.len(), |a, _| {
                let from_held = (0..n).filter_map(|j| Some(normal[(free[a], j)] * held[j]?));
                right[free[a]] - from_held.sum::<f64>()
            });
            let solution = if free.is_empty() {
                vector
            } else {
                matrix.lu().solve(&vector)?
            };
            let mut parameters: Vec<f64> = held.iter().map(|h| h.unwrap_or(0.0)).collect();
            (free.iter().zip(solution.iter())).for_each(|(&i, x)| parameters[i] = *x);
            if parameters.iter().any(|x| !x.is_finite()) {
                return None;
            }
            let upper = |i: usize| match self {
                Self::Diffuse { .. } if i >= 3 => f64::INFINITY,
                Self::Lobe if i == 3 => MAX_SPECULAR,
                _ => 1.0,
            };
            let mut violated = false;
            for &i in &free {
                if !(0.0..=upper(i)).contains(&parameters[i]) {
                    held[i] = Some(parameters[i].clamp(0.0, upper(i)));
                    violated = true;
                }
            }
            if violated {
                continue;
            }
            if self == Self::Lobe {
                // The base's albedo is at most one.
                let max = 1.0 - parameters[3];
                parameters[..3].iter_mut().for_each(|u| *u = u.min(max));
            }
            return Some(parameters);
        }
    }

    /// Variances of the residuals of rows that are not [`decorrelated`].
    pub fn variances(self, rows: &[Row], parameters: &[f64]) -> Variances {
        let (mut within, mut freedom) = (0.0, 0usize);
        let mut means = Vec::new();
        for spot in rows.chunk_by(|a, b| a.spot == b.spot) {
            let weight: f64 = spot.iter().map(|r| r.weight).sum();
            let residuals: Vec<[DVec3; 2]> =
                spot.iter().map(|r| self.residuals(r, parameters)).collect();
            let mean = [0, 1].map(|set| {
                let sum: DVec3 = (spot.iter().zip(&residuals))
                    .map(|(row, residual)| residual[set] * row.weight)
                    .sum();
                sum / weight
            });
            for (row, [a, b]) in spot.iter().zip(&residuals) {
                within += row.weight * (*a - mean[0]).dot(*b - mean[1]) / 3.0;
            }
            freedom += spot.len() - 1;
            means.push((mean[0].dot(mean[1]) / 3.0, weight));
        }
        let total: f64 = means.iter().map(|m| m.0).sum();
        let inverse: f64 = means.iter().map(|m| 1.0 / m.1).sum();
        let count = means.len().max(1) as f64;
        let within = match freedom {
            0 => MIN_VARIANCE,
            _ => (within / freedom as f64).max(MIN_VARIANCE),
        };
        Variances {
            within,
            between: ((total - within * inverse) / count).max(0.0),
        }
    }
}

/// Greatest specular reflectance at normal incidence.
const MAX_SPECULAR: f64 = 0.98;
/// Least relative variance: photographs and meshes are no better.
const MIN_VARIANCE: f64 = 1e-6;

/// The rows minus a fraction of their spot's mean, which makes their errors independent and of equal variance. `fraction` is
/// given the weight of the spot; a fraction of one gives each spot a free albedo.
pub fn decorrelated(rows: &[Row], fraction: impl Fn(f64) -> f64) -> Vec<Row> {
    let mut all = Vec::with_capacity(rows.len());
    for spot in rows.chunk_by(|a, b| a.spot == b.spot) {
        let weight: f64 = spot.iter().map(|r| r.weight).sum();
        let fraction = fraction(weight);
        let mean = |value: &dyn Fn(&Row) -> DVec3| {
            spot.iter().map(|r| value(r) * r.weight).sum::<DVec3>() * (fraction / weight)
        };
        let (measured, one) = (mean(&|r| r.measured), mean(&|r| r.one));
        let components = [0, 1].map(|set| {
            let mut sum = Components::default();
            for row in spot {
                sum = sum.zip(row.sets[set], |sum, own| sum + own * row.weight);
            }
            sum.map(|component| component * (fraction / weight))
        });
        all.extend(spot.iter().map(|row| Row {
            measured: row.measured - measured,
            one: row.one - one,
            sets: [0, 1].map(|set| row.sets[set].zip(components[set], |own, mean| own - mean)),
            ..*row
        }));
    }
    all
}

impl Variances {
    /// Rows [`decorrelated`] for these variances.
    pub fn decorrelate(&self, rows: &[Row]) -> Vec<Row> {
        decorrelated(rows, |weight| {
            1.0 - (1.0 + weight * self.between / self.within).sqrt().recip()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;

    /// Two observations of each of 200 spots of random albedo, with noise in the photographs and in both sets.
    fn rows(albedo: f64, specular: f64, texture: f64) -> Vec<Row> {
        let mut stream = Stream::new(17, 0, 0, 0);
        let mut uniform = || f64::from(stream.uniform());
        let mut rows = Vec::new();
        for spot in 0..200 {
            let own = albedo * (1.0 + texture * (2.0 * uniform() - 1.0));
            for _ in 0..2 {
                let truth = Components {
                    diffuse: DVec3::splat(1.0),
                    base: DVec3::splat(0.9 + 0.1 * uniform()),
                    lobe: DVec3::splat(0.5 + uniform()),
                    grazing: DVec3::splat(0.05 * uniform()),
                };
                let radiance = truth.base * own * (1.0 - specular)
                    + truth.lobe * specular
                    + truth.grazing * (1.0 - specular);
                let mut noisy = |v: DVec3, size: f64| v * (1.0 + size * (2.0 * uniform() - 1.0));
                let measured = noisy(radiance, 0.02);
                let sets = [0, 1].map(|_| Components {
                    lobe: noisy(truth.lobe, 0.5),
                    base: noisy(truth.base, 0.2),
                    ..truth
                });
                rows.push(Row {
                    spot,
                    weight: 4.0,
                    measured,
                    one: DVec3::ONE,
                    sets,
                });
            }
        }
        rows
    }

    #[test]
    fn noise_of_paths_biases_neither_albedo_nor_specular() {
        let found = Model::Lobe.fit(&rows(0.5, 0.2, 0.0)).expect("rows tell");
        assert!((found[3] - 0.2).abs() < 0.02, "{found:?}");
        let albedo = found[0] / (1.0 - found[3]);
        assert!((albedo - 0.5).abs() < 0.03, "{found:?}");
    }

    #[test]
    fn texture_is_told_from_noise_and_taken_off() {
        let rows = rows(0.5, 0.2, 0.5);
        let first = Model::Lobe.fit(&rows).expect("rows tell");
        let variances = Model::Lobe.variances(&rows, &first);
        assert!(variances.between > 4.0 * variances.within, "{variances:?}");
        let found = Model::Lobe
            .fit(&variances.decorrelate(&rows))
            .expect("rows tell");
        assert!((found[3] - 0.2).abs() < 0.03, "{found:?}");
    }

    #[test]
    fn parameters_stay_within_their_bounds() {
        let mut rows = rows(0.5, 0.0, 0.0);
        rows.iter_mut().for_each(|r| r.measured *= 3.0);
        let found = Model::Lobe.fit(&rows).expect("rows tell");
        assert!(found.iter().all(|x| (0.0..=1.0).contains(x)), "{found:?}");
        assert!(found[0] + found[3] <= 1.0 + 1e-12, "{found:?}");
        assert_eq!(Model::Lobe.fit(&[]), None);
    }
}
