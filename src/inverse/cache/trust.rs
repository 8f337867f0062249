//! How far the photographs of each object are to be trusted: the weights of the fit, from its own residuals.
//!
//! Least squares are best where every term weighs by the inverse of its variance. That variance differs from object to
//! object: a lamp is seen with no noise from paths at all, a textured surface is badly described by one albedo. It is
//! read off the residuals and the fit repeated (feasible generalised least squares, Aitken 1935, Zellner 1962). What a
//! change of the object's own albedo or emission would take away is left out of them: else an object whose albedo is
//! wrong would be distrusted for it, and the distrust would keep it wrong.

use super::evaluate::Linearised;
use glam::DVec3;

/// Clusters that the typical variance counts for beside an object's own.
const PRIOR_CLUSTERS: f64 = 4.0;
/// Relative error of a cluster's mean below which nothing is trusted to be: cameras and meshes are no better.
const FLOOR: f64 = 1e-3;
/// Median of χ² with one degree of freedom.
const MEDIAN_CHI2: f64 = 0.454_936;

/// Factors on the weights of the clusters of each object, per channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Trust(Vec<DVec3>);

impl Trust {
    /// The same for all.
    pub fn even(objects: usize) -> Self {
        Self(vec![DVec3::ONE; objects])
    }

    /// From the residuals that a fit has left.
    pub fn from_residuals(clusters: &[Linearised], objects: usize) -> Self {
        // The typical variance is a median, which no badly described object can raise.
        let squares = squares(clusters, objects);
        let typical = DVec3::from_array(std::array::from_fn(|channel| {
            let mut values: Vec<f64> = squares.iter().map(|s| s[channel]).collect();
            crate::math::stats::quantile(&mut values, 0.5).unwrap_or(0.0) / MEDIAN_CHI2
        }));

        let mut sums = vec![(DVec3::ZERO, 0.0, DVec3::ZERO); objects];
        for (cluster, square) in clusters.iter().zip(&squares) {
            let sum = &mut sums[cluster.object as usize];
            sum.0 += *square;
            sum.1 += 1.0;
            sum.2 += cluster.floor * (FLOOR * FLOOR);
        }
        let factor = |(sum, count, floor): (DVec3, f64, DVec3)| {
            let own = (sum + typical * PRIOR_CLUSTERS) / (count + PRIOR_CLUSTERS);
            let least = if count > 0.0 {
                floor / count
            } else {
                DVec3::ZERO
            };
            // With no residuals at all there is nothing to tell objects apart by.
            DVec3::select(
                typical.cmpgt(DVec3::ZERO),
                typical / own.max(least),
                DVec3::ONE,
            )
        };
        Self(sums.into_iter().map(factor).collect())
    }

    /// The factor of one object.
    pub fn of(&self, object: u32) -> DVec3 {
        self.0[object as usize]
    }
}

/// Weighted squares of the clusters' residuals, from both sets together, about the best own parameter of each object.
fn squares(clusters: &[Linearised], objects: usize) -> Vec<DVec3> {
    let residual = |c: &Linearised| (c.residuals[0] + c.residuals[1]) * 0.5;
    let mut sums = vec![(DVec3::ZERO, DVec3::ZERO); objects];
    for cluster in clusters {
        let (top, bottom) = &mut sums[cluster.object as usize];
        *top += cluster.weight * cluster.own * residual(cluster);
        *bottom += cluster.weight * cluster.own * cluster.own;
    }
    let steps: Vec<DVec3> = (sums.into_iter())
        .map(|(top, bottom)| DVec3::select(bottom.cmpgt(DVec3::ZERO), top / bottom, DVec3::ZERO))
        .collect();
    (clusters.iter())
        .map(|cluster| {
            let left = residual(cluster) - cluster.own * steps[cluster.object as usize];
            cluster.weight * left * left
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clusters(
        object: u32,
        residuals: impl Iterator<Item = f64>,
    ) -> impl Iterator<Item = Linearised> {
        residuals.map(move |r| Linearised {
            object,
            weight: DVec3::ONE,
            floor: DVec3::ONE,
            residuals: [DVec3::splat(r); 2],
            own: DVec3::ZERO,
            rows: Vec::new(),
        })
    }

    /// Residuals of a given deviation, by turns.
    fn noise(count: usize, deviation: f64) -> impl Iterator<Item = f64> {
        (0..count).map(move |i| deviation * [1.0, -1.0, 0.6, -1.2][i % 4])
    }

    #[test]
    fn factors_are_inverse_variances_relative_to_the_typical_one() {
        let all: Vec<Linearised> = clusters(0, noise(400, 0.1))
            .chain(clusters(1, noise(100, 0.01)))
            .chain(clusters(2, noise(100, 1.0)))
            .collect();
        let trust = Trust::from_residuals(&all, 4);
        let ratio = trust.of(1) / trust.of(0);
        // The typical variance counts for four clusters beside the quiet object's hundred and keeps the ratio below 100.
        assert!(
            ratio.min_element() > 8.0 && ratio.max_element() < 100.0,
            "{ratio}"
        );
        let ratio = trust.of(0) / trust.of(2);
        assert!(
            (ratio - DVec3::splat(100.0)).abs().max_element() < 5.0,
            "{ratio}"
        );
        assert_eq!(trust.of(3), trust.of(3).min(DVec3::ONE).max(DVec3::ONE));
    }

    #[test]
    fn a_wrong_albedo_costs_no_trust() {
        let right: Vec<Linearised> = clusters(0, noise(100, 0.1))
            .chain(clusters(1, noise(100, 0.1)))
            .collect();
        let mut wrong = right.clone();
        for (index, cluster) in wrong.iter_mut().enumerate().skip(100) {
            cluster.own = DVec3::splat(1.0 + (index / 4 % 3) as f64);
            for residual in &mut cluster.residuals {
                *residual += cluster.own * 0.8;
            }
        }
        let [right, wrong] = [right, wrong].map(|c| Trust::from_residuals(&c, 2).of(1));
        assert!(
            (right / wrong - DVec3::ONE).abs().max_element() < 0.02,
            "{wrong}"
        );
    }

    #[test]
    fn no_residuals_are_trusted_below_the_floor_and_none_at_all_leaves_weights_even() {
        let all: Vec<Linearised> = clusters(0, noise(100, 0.1))
            .chain(clusters(1, noise(1_000_000, 0.0).take(90)))
            .collect();
        let trust = Trust::from_residuals(&all, 2);
        assert!(trust.of(1).is_finite());
        let silent: Vec<Linearised> = clusters(0, noise(10, 0.0)).collect();
        assert_eq!(Trust::from_residuals(&silent, 1), Trust::even(1));
        assert_eq!(Trust::from_residuals(&[], 2), Trust::even(2));
    }
}
