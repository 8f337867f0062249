//! Robust weights of the fit, per object and channel, from the residuals of the previous fit.
//!
//! Least squares are optimal if every term weighs by its inverse variance. The variance differs between objects: lamps have no
//! path noise, and textured surfaces are badly described by one albedo. It is estimated from the residuals and the fit repeated
//! (feasible generalised least squares, Aitken 1935, Zellner 1962). Residuals are taken after the best step of the object's own
//! albedo or emission; otherwise a wrong albedo would lower the object's weight and so stay wrong.
//!
//! Outlier clusters, at the edge of a lamp or where somebody walked by, have a bounded influence (Huber 1964) on the fit and on
//! the variances.

use crate::inverse::paths::evaluate::Linearised;
use crate::math::stats::{medians, weighted_median};
use glam::DVec3;
use rayon::prelude::*;

/// Number of clusters that the typical log variance counts for in the mean with an object's own.
const PRIOR_CLUSTERS: f64 = 2.0;
/// Least relative error of a pixel: cameras and meshes are no better.
const FLOOR: f64 = 1e-3;
/// Least variance of an object over the typical one: objects that are nearly black have almost no residuals and would dominate.
const MIN_OF_TYPICAL: f64 = 1e-2;
/// Median of χ² with one degree of freedom.
const MEDIAN_CHI2: f64 = 0.454_936;
/// Standard deviations beyond which a cluster's influence is constant. Noise of photographs and paths at the edges of lamps is
/// skewed, and a lower bound would bias the fit.
const MAX_DEVIATIONS: f64 = 10.0;

/// Factors on the weights of the clusters, per channel.
#[derive(Debug, Clone, PartialEq)]
pub struct RobustWeights(Vec<ObjectWeights>);

/// Statistics of the residuals of an object's clusters.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ObjectWeights {
    /// Typical variance over the object's variance.
    factor: DVec3,
    /// The object's weighted variance; infinite if it is unknown.
    variance: DVec3,
    /// The step of the object's own albedo or emission that fits its clusters best.
    step: DVec3,
}

impl RobustWeights {
    /// Factors of one.
    pub fn even(objects: usize) -> Self {
        Self(vec![
            ObjectWeights {
                factor: DVec3::ONE,
                variance: DVec3::INFINITY,
                step: DVec3::ZERO,
            };
            objects
        ])
    }

    /// From the residuals of a fit.
    pub fn from_residuals(clusters: &[Linearised], objects: usize) -> Self {
        let steps = own_steps(clusters, objects);
        // Lower bounds that hold have no residual.
        let (clusters, squares): (Vec<&Linearised>, Vec<DVec3>) = (clusters.iter())
            .filter(|cluster| !cluster.bound_met().any())
            .map(|cluster| (cluster, square(cluster, steps[cluster.object as usize])))
            .unzip();
        // A median, robust to badly described objects.
        let typical = typical_variance(&squares);
        let mut of_object: Vec<Vec<DVec3>> = vec![Vec::new(); objects];
        let mut floors = vec![0.0; objects];
        for (cluster, square) in clusters.iter().zip(&squares) {
            of_object[cluster.object as usize].push(*square);
            floors[cluster.object as usize] += cluster.pixels * (FLOOR * FLOOR);
        }
        let robust = |((squares, floor), step): ((Vec<DVec3>, f64), DVec3)| {
            let count = squares.len() as f64;
            // Variances differ by orders of magnitude, so logarithms are averaged with the typical one's.
            let fraction = count / (count + PRIOR_CLUSTERS);
            let shrunk = |own: DVec3| own.powf(fraction) * typical.powf(1.0 - fraction);
            let usual = shrunk(typical_variance(&squares));
            let max = usual * (MAX_DEVIATIONS * MAX_DEVIATIONS);
            let sum: DVec3 = squares.iter().map(|s| s.min(max)).sum();
            let [own, min] = [sum, DVec3::splat(floor)].map(|s| s / f64::max(count, 1.0));
            let variance = shrunk(own).max(min).max(typical * MIN_OF_TYPICAL);
            // Without any residuals all factors are one.
            let known = typical.cmpgt(DVec3::ZERO);
            ObjectWeights {
                factor: DVec3::select(known, typical / variance, DVec3::ONE),
                variance: DVec3::select(known, variance, DVec3::INFINITY),
                step,
            }
        };
        let all = of_object.into_iter().zip(floors).zip(steps);
        Self(all.map(robust).collect())
    }

    /// The weight of a cluster in the fit, with the bound of outliers.
    pub fn weight(&self, cluster: &Linearised) -> DVec3 {
        let robust = &self.0[cluster.object as usize];
        let max = robust.variance * (MAX_DEVIATIONS * MAX_DEVIATIONS);
        let square = square(cluster, robust.step);
        let bounded = DVec3::select(square.cmpgt(max), (max / square).powf(0.5), DVec3::ONE);
        cluster.weight_now() * robust.factor * bounded
    }
}

/// The variance of a normal distribution with the same median of squares; zero without values.
fn typical_variance(squares: &[DVec3]) -> DVec3 {
    medians(squares.iter().copied()) / MEDIAN_CHI2
}

/// Weighted square of a cluster's residual after a step of its object's own parameter.
fn square(cluster: &Linearised, step: DVec3) -> DVec3 {
    let residual = cluster.residual() - cluster.own * step;
    cluster.weight * residual * residual
}

/// For each object and channel, the step of its own parameter of least absolute residuals: a weighted median, robust to outliers.
fn own_steps(clusters: &[Linearised], objects: usize) -> Vec<DVec3> {
    let mut of_object: Vec<Vec<&Linearised>> = vec![Vec::new(); objects];
    for cluster in clusters {
        of_object[cluster.object as usize].push(cluster);
    }
    let step = |clusters: Vec<&Linearised>| {
        DVec3::from_array(std::array::from_fn(|channel| {
            let own = |cluster: &Linearised| cluster.own[channel];
            let ratios = (clusters.iter().filter(|cluster| own(cluster) > 0.0)).map(|cluster| {
                let weight = cluster.weight_now()[channel].sqrt() * own(cluster);
                (cluster.residual()[channel] / own(cluster), weight)
            });
            weighted_median(ratios.collect()).unwrap_or(0.0)
        }))
    };
    of_object.into_par_iter().map(step).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clusters(
        object: u32,
        residuals: impl Iterator<Item = f64>,
    ) -> impl Iterator<Item = Linearised> {
        residuals.map(move |r| Linearised::unit(object, DVec3::splat(r)))
    }

    /// Residuals of about the given deviation, of alternating sign.
    fn noise(count: usize, deviation: f64) -> impl Iterator<Item = f64> {
        (0..count).map(move |i| deviation * [1.0, -1.0, 0.6, -1.2][i % 4])
    }

    #[test]
    fn factors_are_inverse_variances_relative_to_the_typical_one() {
        let all: Vec<Linearised> = clusters(0, noise(400, 0.1))
            .chain(clusters(1, noise(100, 0.01)))
            .chain(clusters(2, noise(100, 1.0)))
            .collect();
        let robust = RobustWeights::from_residuals(&all, 4);
        let between = |ratio: DVec3, [min, max]: [f64; 2]| {
            assert!(
                ratio.min_element() > min && ratio.max_element() < max,
                "{ratio}"
            );
        };
        // The typical variance counts for two clusters and the object's for 100, which keeps the ratio below 100.
        between(robust.0[1].factor / robust.0[0].factor, [8.0, 100.0]);
        // The same for the noisy object: 100 to the power of 100/102; the typical variance is a little above the first object's.
        between(robust.0[0].factor / robust.0[2].factor, [90.0, 95.0]);
        assert_eq!(robust.0[3].factor, DVec3::ONE);
    }

    #[test]
    fn the_influence_of_an_outlier_is_bounded() {
        let quiet: Vec<Linearised> = clusters(0, noise(400, 0.1))
            .chain(clusters(1, noise(40, 0.1)))
            .collect();
        let mut edges = quiet.clone();
        for cluster in &mut edges[400..401] {
            cluster.residuals = [DVec3::splat(50.0); 2];
        }
        let [quiet, disturbed] = [&quiet, &edges].map(|c| RobustWeights::from_residuals(c, 2));
        // One of 40 clusters counts for ten deviations; unbounded, the factor would fall to a 50,000th.
        assert!((disturbed.0[1].factor / quiet.0[1].factor).min_element() > 0.15);
        let influence = |cluster: &Linearised| disturbed.weight(cluster) * cluster.residuals[0];
        let usual = disturbed.0[1].factor * 0.1;
        let ratio = (influence(&edges[400]) / usual).x;
        // Ten deviations, which the cluster itself doubles, instead of 500.
        assert!((10.0..30.0).contains(&ratio), "{ratio}");
        assert_eq!(RobustWeights::even(2).weight(&edges[400]), DVec3::ONE);
    }

    #[test]
    fn a_wrong_albedo_does_not_lower_the_weight() {
        let even = |object| clusters(object, (0..100).map(|i| 0.05 * (i % 5) as f64 - 0.1));
        let right: Vec<Linearised> = even(0).chain(even(1)).collect();
        let mut wrong = right.clone();
        for (index, cluster) in wrong.iter_mut().enumerate().skip(100) {
            cluster.own = DVec3::splat(1.0 + (index / 5 % 3) as f64);
            for residual in &mut cluster.residuals {
                *residual += cluster.own * 0.8;
            }
        }
        let [right, wrong] =
            [right, wrong].map(|c| RobustWeights::from_residuals(&c, 2).0[1].factor);
        let gained = wrong / right - DVec3::ONE;
        assert!(gained.abs().max_element() < 0.03, "{gained}");
    }

    /// 2 % of the clusters are 100 deviations brighter; their effect on the object's albedo stays small.
    #[test]
    fn outliers_do_not_raise_their_own_bound() {
        let mut all: Vec<Linearised> = clusters(0, noise(400, 0.1)).collect();
        for cluster in &mut all {
            cluster.own = DVec3::ONE;
        }
        for cluster in all.iter_mut().step_by(50) {
            cluster.residuals = [DVec3::splat(10.0); 2];
        }
        let robust = RobustWeights::from_residuals(&all, 1);
        let (top, bottom) = all.iter().fold((0.0, 0.0), |(top, bottom), cluster| {
            let weight = robust.weight(cluster).x;
            (top + weight * cluster.residuals[0].x, bottom + weight)
        });
        // 2 % of the clusters at a bound of ten deviations of 0.1; unbounded it is 0.2.
        let moved = top / bottom;
        assert!((0.0..0.04).contains(&moved), "{moved}");
    }

    #[test]
    fn objects_without_residuals_have_bounded_weights() {
        let all: Vec<Linearised> = clusters(0, noise(100, 0.1))
            .chain(clusters(1, noise(1_000_000, 0.0).take(90)))
            .collect();
        let robust = RobustWeights::from_residuals(&all, 2);
        // The factor of an object without residuals is limited to 100.
        assert!(
            (robust.0[1].factor - DVec3::splat(100.0))
                .abs()
                .max_element()
                < 1e-9
        );
        let bound_met: Vec<Linearised> = clusters(0, noise(10, 0.0)).collect();
        for (clusters, objects) in [(&bound_met[..], 1), (&[], 2)] {
            let found = RobustWeights::from_residuals(clusters, objects);
            assert_eq!(found, RobustWeights::even(objects));
        }
    }
}
