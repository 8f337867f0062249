//! The prior of light from a sky: deviations from what is expected of it are correlated over directions and common to the three
//! channels up to a tint.
//!
//! In each direction d and channel c, L = C (b + τ) with the expected radiance C, the relative brightness b ~ N(1, K) over all
//! directions, and independent tints τ ~ N(0, t²). Channels are fitted one after another, each with the brightness integrated out:
//! what the other two channels say of b is part of its prior.

use crate::math::cholesky;
use glam::Vec3;
use nalgebra::{DMatrix, DVector};

/// Weight of what another channel says of the brightness. The paths of all channels are the same, so that their noise is: each
/// two others count as one.
const CHANNEL_WEIGHT: f64 = 0.5;

/// Distribution of the radiance of sky directions.
#[derive(Debug, Clone, PartialEq)]
pub struct SkyPrior {
    /// Expected radiance C of each direction.
    pub radiance: Vec<Vec3>,
    /// Covariance K of the relative brightness.
    pub covariance: DMatrix<f64>,
    /// Standard deviation t of the tint in each direction.
    pub tint: Vec<f32>,
}

/// What one channel's pixels say of the radiance y of some directions: ½ yᵀ S y − rᵀ y is half the squared error over its variance.
pub struct Information {
    /// S.
    pub curvature: DMatrix<f64>,
    /// r.
    pub slope: DVector<f64>,
}

/// A normal distribution.
pub struct Normal {
    /// Its mean.
    pub mean: DVector<f64>,
    /// The inverse of its covariance.
    pub precision: DMatrix<f64>,
    /// The diagonal of its covariance.
    pub variance: DVector<f64>,
}

impl SkyPrior {
    /// The distribution of the radiance of `directions` in each channel, given what the pixels say in all three.
    pub fn channels(
        &self,
        directions: &[usize],
        information: &[Information; 3],
    ) -> Option<[Normal; 3]> {
        let n = directions.len();
        let relative =
            DMatrix::from_fn(n, n, |i, j| self.covariance[(directions[i], directions[j])]);
        let own = inverse(relative)?;
        let messages: Vec<Information> = (information.iter().enumerate())
            .map(|(channel, said)| self.of_brightness(directions, channel, said))
            .collect::<Option<_>>()?;
        let channel = |channel: usize| {
            let mut precision = own.clone();
            let mut slope = &own * DVector::from_element(n, 1.0);
            for other in (0..3).filter(|other| *other != channel) {
                precision += &messages[other].curvature * CHANNEL_WEIGHT;
                slope += &messages[other].slope * CHANNEL_WEIGHT;
            }
            let brightness = inverse(precision)?;
            let mean = &brightness * slope;
            let (color, tint) = (self.colors(directions, channel), self.tints(directions));
            let covariance = DMatrix::from_fn(n, n, |i, j| {
                let tint = if i == j { tint[i] * tint[i] } else { 0.0 };
                color[i] * color[j] * (brightness[(i, j)] + tint)
            });
            Some(Normal {
                mean: mean.component_mul(&color),
                variance: covariance.diagonal(),
                precision: inverse(covariance)?,
            })
        };
        Some([channel(0)?, channel(1)?, channel(2)?])
    }

    /// What one channel says of the relative brightness, with the tints integrated out.
    fn of_brightness(
        &self,
        directions: &[usize],
        channel: usize,
        said: &Information,
    ) -> Option<Information> {
        let (color, tint) = (self.colors(directions, channel), self.tints(directions));
        let n = directions.len();
        // C S C + t⁻², all relative to the expected radiance.
        let precision = tint.map(|t| (t * t).recip());
        let curvature = DMatrix::from_fn(n, n, |i, j| color[i] * color[j] * said.curvature[(i, j)]);
        let slope = said.slope.component_mul(&color);
        let with_tint = inverse(curvature + DMatrix::from_diagonal(&precision))?;
        let tinted = |i: usize, j: usize| precision[i] * precision[j] * with_tint[(i, j)];
        Some(Information {
            slope: (&with_tint * slope).component_mul(&precision),
            curvature: DMatrix::from_fn(n, n, |i, j| {
                let own = if i == j { precision[i] } else { 0.0 };
                own - tinted(i, j)
            }),
        })
    }

    fn colors(&self, directions: &[usize], channel: usize) -> DVector<f64> {
        let color = |d: &usize| self.radiance[*d].as_dvec3()[channel].max(f64::MIN_POSITIVE);
        DVector::from_iterator(directions.len(), directions.iter().map(color))
    }

    fn tints(&self, directions: &[usize]) -> DVector<f64> {
        let tint = |d: &usize| f64::from(self.tint[*d]);
        DVector::from_iterator(directions.len(), directions.iter().map(tint))
    }
}

/// The inverse of a symmetric positive definite matrix; `None` if it is not.
fn inverse(matrix: DMatrix<f64>) -> Option<DMatrix<f64>> {
    Some(cholesky::inverse(&cholesky::factor(matrix)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two() -> (SkyPrior, [Information; 3]) {
        let sky = SkyPrior {
            radiance: vec![Vec3::new(1.0, 2.0, 3.0), Vec3::new(2.0, 2.5, 4.0)],
            covariance: DMatrix::from_row_slice(2, 2, &[0.5, 0.3, 0.3, 0.8]),
            tint: vec![0.1, 0.2],
        };
        let information = [0.0, 1.0, 2.0].map(|c| Information {
            curvature: DMatrix::from_row_slice(2, 2, &[3.0 + c, 0.4, 0.4, 1.0 + 2.0 * c]),
            slope: DVector::from_row_slice(&[4.0 - c, 1.0 + c]),
        });
        (sky, information)
    }

    /// All unknowns at once: the brightness of both directions, and their radiance in a channel with its tint.
    #[test]
    fn a_channels_prior_is_the_marginal_of_the_joint_distribution() {
        let (sky, information) = two();
        let found = sky.channels(&[0, 1], &information).expect("definite");
        let color = |d: usize, c: usize| f64::from(sky.radiance[d][c]);
        let precise = |d: usize, c: usize| (color(d, c) * f64::from(sky.tint[d])).powi(-2);
        // Precision and slope of brightness and radiance in one channel, without the prior of the brightness.
        let joint = |c: usize, said: Option<&Information>| {
            let mut precision = DMatrix::zeros(4, 4);
            let mut slope = DVector::zeros(4);
            for d in 0..2 {
                precision[(d, d)] = precise(d, c) * color(d, c).powi(2);
                precision[(d, d + 2)] = -precise(d, c) * color(d, c);
                precision[(d + 2, d)] = precision[(d, d + 2)];
                precision[(d + 2, d + 2)] = precise(d, c);
                for e in 0..2 {
                    precision[(d + 2, e + 2)] += said.map_or(0.0, |s| s.curvature[(d, e)]);
                }
                slope[d + 2] = said.map_or(0.0, |s| s.slope[d]);
            }
            (precision, slope)
        };
        let inverse = |m: DMatrix<f64>| m.try_inverse().expect("definite");
        let own = inverse(sky.covariance.clone());
        for (c, found) in found.iter().enumerate() {
            let (mut precision, mut slope) = joint(c, None);
            let mut add = |block: &DMatrix<f64>, vector: &DVector<f64>, weight: f64| {
                for d in 0..2 {
                    slope[d] += weight * vector[d];
                    for e in 0..2 {
                        precision[(d, e)] += weight * block[(d, e)];
                    }
                }
            };
            add(&own, &(&own * DVector::from_element(2, 1.0)), 1.0);
            for other in (0..3).filter(|other| *other != c) {
                let (all, right) = joint(other, Some(&information[other]));
                let (b, l) = (all.view((0, 0), (2, 2)), all.view((2, 2), (2, 2)));
                let cross = all.view((0, 2), (2, 2)) * inverse(l.clone_owned());
                let said = -&cross * right.rows(2, 2);
                add(
                    &(b - &cross * all.view((2, 0), (2, 2))),
                    &said,
                    CHANNEL_WEIGHT,
                );
            }
            let covariance = inverse(precision);
            let mean = &covariance * slope;
            let block = inverse(covariance.view((2, 2), (2, 2)).clone_owned());
            for d in 0..2 {
                assert!((found.mean[d] / mean[d + 2] - 1.0).abs() < 1e-9);
                assert!((found.variance[d] / covariance[(d + 2, d + 2)] - 1.0).abs() < 1e-9);
                for e in 0..2 {
                    let (a, b) = (found.precision[(d, e)], block[(d, e)]);
                    assert!((a - b).abs() < 1e-9 * block.amax(), "{a} {b}");
                }
            }
        }
    }

    #[test]
    fn without_information_a_channel_has_what_is_expected() {
        let (sky, _) = two();
        let nothing = [(); 3].map(|()| Information {
            curvature: DMatrix::zeros(1, 1),
            slope: DVector::zeros(1),
        });
        let found = sky.channels(&[1], &nothing).expect("definite");
        for (c, normal) in found.iter().enumerate() {
            let color = f64::from(sky.radiance[1][c]);
            assert!((normal.mean[0] / color - 1.0).abs() < 1e-9);
            let variance = color * color * (0.8 + f64::from(sky.tint[1]).powi(2));
            assert!((normal.variance[0] / variance - 1.0).abs() < 1e-9);
        }
    }
}
