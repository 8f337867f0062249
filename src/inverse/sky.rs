//! What light from outside looks like where no photograph shows it: Gaussian process regression (Rasmussen and Williams 2006,
//! equations 2.25 and 2.26) of the logarithm of its radiance over directions.
//!
//! The logarithm changes linearly with the sine of the elevation, as between the horizon and the zenith of a sky, and by patches.
//! The ground below the horizon is another such function.

use crate::math::cholesky;
use crate::math::color::luminance;
use crate::transport::environment::{directions, pixel_of};
use glam::{DVec3, Vec3};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

/// Standard deviation of the mean logarithm over all directions: the level is as good as free.
const LEVEL: f64 = 3.0;
/// Standard deviation of the difference between the logarithms of sky and ground.
const HALF: f64 = 1.0;
/// Standard deviation of the logarithm's change from the horizon to the zenith: the root mean square over the 15 skies of CIE S 011
/// is 1.07.
const SLOPE: f64 = 1.0;
/// Standard deviation of the rest, and the angle in radians at which its correlation is 1/e. The light around the sun in the skies
/// of CIE S 011 has 0.44, and half the correlation at 0.7; clouds, trees and houses add to it. Of 0.5 and 0.9 the latter gives the
/// smaller errors in rooms 1 to 12 of `relit demo --family window --seed N`, solved by `preview`.
const PATCH: f64 = 0.5;
const PATCH_ANGLE: f64 = 0.9;
/// Standard deviation of what changes from one direction to the next. Of 0.1 and 0.2 the former gives the smaller median there.
const GRAIN: f64 = 0.1;
/// Least measured radiance, as a fraction of the mean: what is darker is as good as black.
const MIN_RADIANCE: f64 = 1e-3;
/// Greatest mean square of the measured logarithms in standard deviations, which is one for a sky. What is above is none: lamps and
/// walls that the mesh lacks.
const MAX_SQUARE: f64 = 2.0;

/// Light that photographs show in a unit direction.
#[derive(Debug, Clone, Copy)]
pub struct Seen {
    /// The direction.
    pub direction: Vec3,
    /// Its radiance.
    pub radiance: Vec3,
}

/// A map of directions, and the coarse grid whose pixels are the unknowns of its unmeasured cells.
pub struct Map<'a> {
    /// Columns and rows of the map.
    pub size: [usize; 2],
    /// Whether a cell, whose direction is given too, is measured.
    pub known: &'a dyn Fn(usize, Vec3) -> bool,
    /// Columns and rows of the grid.
    pub grid: [usize; 2],
}

/// What is expected of the unmeasured light, whose unknowns are the pixels of a coarse grid.
#[derive(Debug, Clone)]
pub struct ExpectedSky {
    /// Mean expected radiance of each pixel of the grid over its unmeasured cells.
    pub radiance: Vec<Vec3>,
    /// Covariance of the relative deviations from it, if it is known.
    pub covariance: Option<DMatrix<f64>>,
    /// Whether the colour of each pixel of the grid is known.
    pub has_color: Vec<bool>,
    /// Expected luminance of each cell over that of its pixel of the grid; empty if these are even.
    pub shape: Vec<f32>,
}

impl ExpectedSky {
    /// Expects of each pixel of a grid a radiance by its direction, and whether its colour is known. How these are correlated is
    /// not known.
    pub fn even(grid: [usize; 2], expected: impl Fn(Vec3) -> (Vec3, bool)) -> Self {
        let (radiance, has_color) = directions(grid).map(expected).unzip();
        Self {
            radiance,
            covariance: None,
            has_color,
            shape: Vec::new(),
        }
    }

    /// Expects of the unmeasured cells of a map what goes with `measured` light; `None` if that is black or no sky's.
    pub fn new(measured: &[Seen], up: Vec3, map: &Map) -> Option<Self> {
        let sky = Regression::new(measured, up)?;
        let grid = map.grid;
        let cells: Vec<Vec3> = directions(map.size).collect();
        let expected: Vec<Vec3> = cells.par_iter().map(|d| sky.radiance(*d)).collect();

        // Means over the unmeasured cells of each pixel of the grid; over all of its cells if it has none.
        let pixel = |direction: Vec3| pixel_of(grid[0], grid[1], direction);
        let mut sums = vec![[(DVec3::ZERO, 0.0); 2]; grid[0] * grid[1]];
        for (cell, direction) in cells.iter().enumerate() {
            let known = (map.known)(cell, *direction);
            for (radiance, weight) in &mut sums[pixel(*direction)][usize::from(known)..] {
                *radiance += expected[cell].as_dvec3() * solid_angle(*direction);
                *weight += solid_angle(*direction);
            }
        }
        let radiance: Vec<Vec3> = (sums.iter())
            .map(|[unknown, all]| if unknown.1 > 0.0 { unknown } else { all })
            .map(|(sum, weight)| (*sum / *weight).as_vec3())
            .collect();
        let shape = |(expected, direction): (&Vec3, &Vec3)| {
            luminance(*expected) / luminance(radiance[pixel(*direction)]).max(f32::MIN_POSITIVE)
        };
        let shape = expected.iter().zip(&cells).map(shape).collect();

        let centres: Vec<Vec3> = directions(grid).collect();
        Some(Self {
            covariance: Some(sky.covariance(&centres)),
            has_color: vec![true; centres.len()],
            radiance,
            shape,
        })
    }
}

/// The regression on measured directions.
struct Regression {
    up: Vec3,
    directions: Vec<Vec3>,
    /// Cholesky factor of the covariance of the measured logarithms.
    factor: Cholesky<f64, Dyn>,
    /// Mean logarithm of the measured radiance.
    level: DVec3,
    /// The covariance's inverse times the measured logarithms, less their mean.
    weights: Vec<DVec3>,
}

impl Regression {
    /// The regression on measured light; `None` without any, and if that is no sky's.
    fn new(measured: &[Seen], up: Vec3) -> Option<Self> {
        let n = measured.len();
        let sum: DVec3 = measured.iter().map(|seen| seen.radiance.as_dvec3()).sum();
        let least = sum.max_element() / n.max(1) as f64 * MIN_RADIANCE;
        if least <= 0.0 {
            return None;
        }
        let log = |seen: &Seen| {
            let radiance = seen.radiance.as_dvec3().max(DVec3::splat(least));
            radiance.map(f64::ln)
        };
        let logs: Vec<DVec3> = measured.iter().map(log).collect();
        let level = logs.iter().sum::<DVec3>() / n as f64;
        let own = DMatrix::from_fn(n, n, |i, j| {
            covariance(measured[i].direction, measured[j].direction, up)
                + if i == j { GRAIN * GRAIN } else { 0.0 }
        });
        let factor = cholesky::factor(own)?;
        let channel = |c: usize| DVector::from_fn(n, |i, _| (logs[i] - level)[c]);
        let weights = [0, 1, 2].map(|c| factor.solve(&channel(c)));
        let square: f64 = (0..3).map(|c| channel(c).dot(&weights[c])).sum();
        if square > MAX_SQUARE * 3.0 * n as f64 {
            return None;
        }
        Some(Self {
            up,
            directions: measured.iter().map(|seen| seen.direction).collect(),
            factor,
            level,
            weights: (0..n)
                .map(|i| DVec3::new(weights[0][i], weights[1][i], weights[2][i]))
                .collect(),
        })
    }

    /// The median of the radiance expected in a unit direction.
    fn radiance(&self, direction: Vec3) -> Vec3 {
        let terms = self.directions.iter().zip(&self.weights);
        let above: DVec3 = terms
            .map(|(seen, weight)| *weight * covariance(*seen, direction, self.up))
            .sum();
        (self.level + above).map(f64::exp).as_vec3()
    }

    /// Covariance of the relative deviations from [`Self::radiance`] in unit directions: that of log-normal variables.
    fn covariance(&self, directions: &[Vec3]) -> DMatrix<f64> {
        let cross = DMatrix::from_fn(self.directions.len(), directions.len(), |i, d| {
            covariance(self.directions[i], directions[d], self.up)
        });
        let explained = cross.tr_mul(&self.factor.solve(&cross));
        DMatrix::from_fn(directions.len(), directions.len(), |i, j| {
            let grain = if i == j { GRAIN * GRAIN } else { 0.0 };
            let prior = covariance(directions[i], directions[j], self.up) + grain;
            (prior - explained[(i, j)]).exp_m1()
        })
    }
}

/// Covariance of the logarithms of radiance in two directions, without grain.
fn covariance(a: Vec3, b: Vec3, up: Vec3) -> f64 {
    let [rise_a, rise_b] = [a, b].map(|d| f64::from(d.dot(up)));
    let level = LEVEL * LEVEL;
    if (rise_a > 0.0) != (rise_b > 0.0) {
        return level;
    }
    let angle = f64::from(a.dot(b).clamp(-1.0, 1.0)).acos();
    level
        + HALF * HALF
        + SLOPE * SLOPE * rise_a * rise_b
        + PATCH * PATCH * (-angle / PATCH_ANGLE).exp()
}

/// The solid angle of a map's cell in a direction, up to a factor.
pub fn solid_angle(direction: Vec3) -> f64 {
    f64::from(1.0 - direction.y * direction.y).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::environment::direction_of;

    fn seen(direction: Vec3, radiance: f32) -> Seen {
        Seen {
            direction: direction.normalize(),
            radiance: Vec3::new(0.5, 1.0, 2.0) * radiance,
        }
    }

    /// Directions on a spiral from the horizon up to a sine of the elevation.
    fn spiral(to: f32) -> impl Iterator<Item = Vec3> {
        (0..40).map(move |i| {
            let rise = to * (i as f32 + 0.5) / 40.0;
            let (sin, cos) = (i as f32 * 0.3).sin_cos();
            let flat = (1.0 - rise * rise).sqrt();
            Vec3::new(flat * cos, rise, flat * sin)
        })
    }

    /// The posterior by the inverse of the joint covariance, whose block of unmeasured directions is the posterior's precision.
    #[test]
    fn the_regression_is_that_of_the_joint_normal_distribution() {
        let measured: Vec<Seen> = spiral(0.5)
            .step_by(5)
            .map(|d| seen(d, 1.0 + d.x * d.x + d.y))
            .collect();
        let targets = [Vec3::Y, Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, -0.6, 0.8)];
        let all: Vec<Vec3> = (measured.iter().map(|s| s.direction))
            .chain(targets)
            .collect();
        let joint = DMatrix::from_fn(all.len(), all.len(), |i, j| {
            let grain = if i == j { GRAIN * GRAIN } else { 0.0 };
            covariance(all[i], all[j], Vec3::Y) + grain
        });
        let precision = joint.try_inverse().expect("it is definite");
        let n = measured.len();
        let block = precision.view((n, n), (3, 3)).clone_owned();
        let posterior = block.try_inverse().expect("it is definite");
        let sky = Regression::new(&measured, Vec3::Y).expect("light");
        let found = sky.covariance(&targets);
        for i in 0..3 {
            for j in 0..3 {
                let relative = posterior[(i, j)].exp_m1();
                assert!((found[(i, j)] - relative).abs() < 1e-6 * relative.abs().max(1.0));
            }
        }
        let logs = measured.iter().map(|s| f64::from(s.radiance.y).ln());
        let logs: Vec<f64> = logs.collect();
        let level = logs.iter().sum::<f64>() / n as f64;
        let off = DVector::from_fn(n, |i, _| logs[i] - level);
        let mean = -&posterior * precision.view((n, 0), (3, n)) * off;
        for (target, mean) in targets.iter().zip(mean.iter()) {
            let ratio = f64::from(sky.radiance(*target).y) / (level + mean).exp();
            assert!((ratio - 1.0).abs() < 1e-5, "{ratio}");
        }
    }

    #[test]
    fn a_sky_goes_on_upwards_as_it_began_in_any_unit() {
        for unit in [1e-12f32, 1.0, 1e12] {
            // A clear sky, which darkens by e² to the zenith, seen up to 30°.
            let light = |d: Vec3| unit * (-2.0 * d.y).exp();
            let measured: Vec<Seen> = spiral(0.5).map(|d| seen(d, light(d))).collect();
            let sky = Regression::new(&measured, Vec3::Y).expect("light");
            let zenith = sky.radiance(Vec3::Y) / light(Vec3::Y);
            assert!((0.6..1.8).contains(&zenith.y), "{zenith}");
            assert!(
                (zenith / zenith.y - Vec3::new(0.5, 1.0, 2.0))
                    .abs()
                    .max_element()
                    < 1e-3
            );
            // Near measured directions little is open; the ground may be anything.
            let near = sky.radiance(measured[20].direction) / measured[20].radiance;
            assert!((near - Vec3::ONE).abs().max_element() < 0.05, "{near}");
            let deviation = |d: Vec3| sky.covariance(&[d])[(0, 0)].sqrt();
            assert!(deviation(measured[20].direction) < 0.2);
            assert!(deviation(Vec3::Y) < 1.0 && deviation(-Vec3::Y) > 1.0);
        }
        assert!(Regression::new(&[], Vec3::Y).is_none());
        assert!(Regression::new(&[seen(Vec3::X, 0.0)], Vec3::Y).is_none());
        // Lamps below a ceiling are no sky.
        let lamps = spiral(0.9).enumerate();
        let lamps = lamps.map(|(i, d)| seen(d, if i % 5 == 0 { 50.0 } else { 1.0 }));
        assert!(Regression::new(&lamps.collect::<Vec<_>>(), Vec3::Y).is_none());
    }

    /// A map of which the lower half of the sky is measured: the shape is relative to the mean of the unmeasured cells.
    #[test]
    fn cells_of_a_pixel_have_its_radiance_in_the_mean() {
        let (size, grid) = ([24, 12], [6, 3]);
        let measured: Vec<Seen> = spiral(0.5).map(|d| seen(d, 1.0 - d.y)).collect();
        let map = Map {
            size,
            known: &|_, direction| (0.0..0.5).contains(&direction.y),
            grid,
        };
        let sky = ExpectedSky::new(&measured, Vec3::Y, &map).expect("light");
        assert_eq!(sky.has_color, [true; 18]);
        let mut sums = [[0.0; 2]; 18];
        for cell in 0..24 * 12 {
            let direction = direction_of(24, 12, cell);
            if !(map.known)(cell, direction) {
                let sum = &mut sums[pixel_of(6, 3, direction)];
                sum[0] += f64::from(sky.shape[cell]) * solid_angle(direction);
                sum[1] += solid_angle(direction);
            }
        }
        for [shape, weight] in sums {
            assert!((shape / weight - 1.0).abs() < 1e-5, "{shape} {weight}");
        }
    }
}
