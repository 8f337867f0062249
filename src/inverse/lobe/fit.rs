//! Least squares over an object's observations: as a diffuse surface, or with a lobe of given roughness.
//!
//! With u = albedo (1 − specular), a observation under a lobe shows u·base + specular·(lobe − grazing) + grazing, linear in u
//! and specular (variable projection, Golub and Pereyra 1973: roughness is searched outside). Products are taken across
//! two independent sets of paths, so that their noise biases nothing. What all observations of a spot share may be texture:
//! it counts less the more spots differ (generalised least squares of random effects, Fuller and Battese 1973).

use crate::inverse::lobe::gather::Parts;
use glam::DVec3;
use nalgebra::{DMatrix, DVector};

/// What one observation shows, and what it would show of each part in two independent sets; all relative to its spot's level.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// Index of its spot; rows of a spot lie side by side.
    pub spot: usize,
    /// Pixels.
    pub weight: f64,
    /// Radiance of the photograph.
    pub shown: DVec3,
    /// A radiance of one.
    pub one: DVec3,
    /// The parts.
    pub sets: [Parts; 2],
}

/// What explains the rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Model {
    /// A diffuse surface: albedo of each channel, and emission of each where it may give light.
    Diffuse {
        /// Whether it may give light.
        emits: bool,
    },
    /// A lobe over a diffuse base: albedo (1 − specular) of each channel, and specular.
    Lobe,
}

/// Variances of what a model leaves, of one pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variances {
    /// Between observations of a spot.
    pub within: f64,
    /// Between spots, beyond that.
    pub between: f64,
}

impl Model {
    /// Number of parameters.
    pub fn len(self) -> usize {
        match self {
            Self::Diffuse { emits: false } => 3,
            Self::Lobe => 4,
            Self::Diffuse { emits: true } => 6,
        }
    }

    /// The derivative of one channel of a row with respect to the parameters that it depends on.
    fn slopes(self, row: &Row, set: usize, channel: usize) -> [(usize, f64); 2] {
        let parts = &row.sets[set];
        match self {
            Self::Diffuse { emits } => [
                (channel, parts.diffuse[channel]),
                if emits {
                    (3 + channel, row.one[channel])
                } else {
                    (channel, 0.0)
                },
            ],
            Self::Lobe => [
                (channel, parts.base[channel]),
                (3, parts.lobe[channel] - parts.grazing[channel]),
            ],
        }
    }

    /// What one channel of a row shows with all parameters at zero.
    fn offset(self, row: &Row, set: usize, channel: usize) -> f64 {
        match self {
            Self::Diffuse { .. } => 0.0,
            Self::Lobe => row.sets[set].grazing[channel],
        }
    }

    /// Photograph less model, in both sets.
    pub fn residuals(self, row: &Row, parameters: &[f64]) -> [DVec3; 2] {
        [0, 1].map(|set| {
            DVec3::from_array(std::array::from_fn(|c| {
                let slopes = self.slopes(row, set, c);
                let model: f64 = slopes.iter().map(|&(i, s)| s * parameters[i]).sum();
                row.shown[c] - self.offset(row, set, c) - model
            }))
        })
    }

    /// Σ w r_A r_B.
    pub fn error(self, rows: &[Row], parameters: &[f64]) -> f64 {
        (rows.iter())
            .map(|row| {
                let [a, b] = self.residuals(row, parameters);
                row.weight * a.dot(b)
            })
            .sum()
    }

    /// The parameters of least error within their bounds; `None` where the rows do not tell.
    pub fn fit(self, rows: &[Row]) -> Option<Vec<f64>> {
        let n = self.len();
        let (mut normal, mut right) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for row in rows {
            for c in 0..3 {
                let slopes = [0, 1].map(|set| self.slopes(row, set, c));
                let target = [0, 1].map(|set| row.shown[c] - self.offset(row, set, c));
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

    /// Solves for all parameters, holding at its bound what leaves it.
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
            let mut found = held.iter().map(|h| h.unwrap_or(0.0)).collect::<Vec<f64>>();
            free.iter()
                .zip(solution.iter())
                .for_each(|(&i, x)| found[i] = *x);
            if found.iter().any(|x| !x.is_finite()) {
                return None;
            }
            let bound = |i: usize| match self {
                Self::Diffuse { .. } if i >= 3 => f64::INFINITY,
                Self::Lobe if i == 3 => MAX_SPECULAR,
                _ => 1.0,
            };
            let mut left = false;
            for &i in &free {
                if !(0.0..=bound(i)).contains(&found[i]) {
                    held[i] = Some(found[i].clamp(0.0, bound(i)));
                    left = true;
                }
            }
            if left {
                continue;
            }
            if self == Self::Lobe {
                // No base reflects more than all that the lobe leaves.
                let room = 1.0 - found[3];
                found[..3].iter_mut().for_each(|u| *u = u.min(room));
            }
            return Some(found);
        }
    }

    /// Variances of what is left of rows that are as they were measured.
    pub fn variances(self, rows: &[Row], parameters: &[f64]) -> Variances {
        let (mut within, mut freedom) = (0.0, 0usize);
        let mut means = Vec::new();
        for spot in rows.chunk_by(|a, b| a.spot == b.spot) {
            let weight: f64 = spot.iter().map(|r| r.weight).sum();
            let left: Vec<[DVec3; 2]> =
                spot.iter().map(|r| self.residuals(r, parameters)).collect();
            let mean = [0, 1].map(|set| {
                let sum: DVec3 = (spot.iter().zip(&left))
                    .map(|(r, l)| l[set] * r.weight)
                    .sum();
                sum / weight
            });
            for (row, [a, b]) in spot.iter().zip(&left) {
                within += row.weight * (*a - mean[0]).dot(*b - mean[1]) / 3.0;
            }
            freedom += spot.len() - 1;
            means.push((mean[0].dot(mean[1]) / 3.0, weight));
        }
        let total: f64 = means.iter().map(|m| m.0).sum();
        let inverse: f64 = means.iter().map(|m| 1.0 / m.1).sum();
        let count = means.len().max(1) as f64;
        let within = if freedom > 0 {
            within / freedom as f64
        } else {
            0.0
        };
        let within = within.max(MIN_VARIANCE);
        Variances {
            within,
            between: ((total - within * inverse) / count).max(0.0),
        }
    }
}

/// Specular reflectance at most.
const MAX_SPECULAR: f64 = 0.98;
/// Photographs and meshes are no better than this, squared and relative.
const MIN_VARIANCE: f64 = 1e-6;

/// The rows with a fraction of each spot's mean taken off, so that what is left of them scatters alike and independently: all of it
/// where spots have any albedo each.
pub fn freed(rows: &[Row], fraction: impl Fn(f64) -> f64) -> Vec<Row> {
    let mut all = Vec::with_capacity(rows.len());
    for spot in rows.chunk_by(|a, b| a.spot == b.spot) {
        let weight: f64 = spot.iter().map(|r| r.weight).sum();
        let fraction = fraction(weight);
        let mean = |of: &dyn Fn(&Row) -> DVec3| {
            spot.iter().map(|r| of(r) * r.weight).sum::<DVec3>() * (fraction / weight)
        };
        let (shown, one) = (mean(&|r| r.shown), mean(&|r| r.one));
        let parts = [0, 1].map(|set| {
            let mut sum = Parts::default();
            for row in spot {
                sum += row.sets[set] * row.weight;
            }
            sum * (fraction / weight)
        });
        all.extend(spot.iter().map(|row| Row {
            shown: row.shown - shown,
            one: row.one - one,
            sets: [0, 1].map(|set| row.sets[set] - parts[set]),
            ..*row
        }));
    }
    all
}

impl Variances {
    /// [`freed`] by what these variances call for.
    pub fn free(&self, rows: &[Row]) -> Vec<Row> {
        freed(rows, |weight| {
            1.0 - (1.0 + weight * self.between / self.within).sqrt().recip()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;

    /// Two observations of each of 200 spots, each of its own colour, with noise in the photographs and in both sets.
    fn rows(albedo: f64, specular: f64, texture: f64) -> Vec<Row> {
        let mut stream = Stream::new(17, 0, 0, 0);
        let mut uniform = || f64::from(stream.uniform());
        let mut rows = Vec::new();
        for spot in 0..200 {
            let own = albedo * (1.0 + texture * (2.0 * uniform() - 1.0));
            for _ in 0..2 {
                let parts = Parts {
                    diffuse: DVec3::splat(1.0),
                    base: DVec3::splat(0.9 + 0.1 * uniform()),
                    lobe: DVec3::splat(0.5 + uniform()),
                    grazing: DVec3::splat(0.05 * uniform()),
                };
                let shown = parts.base * own * (1.0 - specular)
                    + parts.lobe * specular
                    + parts.grazing * (1.0 - specular);
                let mut noisy = |v: DVec3, size: f64| v * (1.0 + size * (2.0 * uniform() - 1.0));
                let shown = noisy(shown, 0.02);
                let sets = [0, 1].map(|_| Parts {
                    lobe: noisy(parts.lobe, 0.5),
                    base: noisy(parts.base, 0.2),
                    ..parts
                });
                rows.push(Row {
                    spot,
                    weight: 4.0,
                    shown,
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
        assert!(
            (found[0] / (1.0 - found[3]) - 0.5).abs() < 0.03,
            "{found:?}"
        );
    }

    #[test]
    fn texture_is_told_from_noise_and_taken_off() {
        let rows = rows(0.5, 0.2, 0.5);
        let first = Model::Lobe.fit(&rows).expect("rows tell");
        let variances = Model::Lobe.variances(&rows, &first);
        assert!(variances.between > 4.0 * variances.within, "{variances:?}");
        let freed = variances.free(&rows);
        let found = Model::Lobe.fit(&freed).expect("rows tell");
        assert!((found[3] - 0.2).abs() < 0.03, "{found:?}");
    }

    #[test]
    fn parameters_stay_within_their_bounds() {
        let mut rows = rows(0.5, 0.0, 0.0);
        rows.iter_mut().for_each(|r| r.shown *= 3.0);
        let found = Model::Lobe.fit(&rows).expect("rows tell");
        assert!(found.iter().all(|x| (0.0..=1.0).contains(x)), "{found:?}");
        assert!(found[0] + found[3] <= 1.0 + 1e-12, "{found:?}");
        assert_eq!(Model::Lobe.fit(&[]), None);
    }
}
