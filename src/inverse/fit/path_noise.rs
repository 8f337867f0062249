//! The fraction of a fit's residuals that is path noise, which more paths would reduce, in contrast to photograph noise and
//! model error; and the distribution of paths over clusters.

use crate::inverse::paths::clusters::Cluster;
use crate::inverse::paths::evaluate::Linearised;

/// Number of clusters that the prior, an even mixture of both kinds of noise, counts for.
const PRIOR_CLUSTERS: f64 = 2.0;

/// For each object, the fraction of its squared residuals that path noise explains, from 0 to 1.
pub fn fractions(clusters: &[Linearised], objects: usize) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0, 0.0); objects];
    for cluster in clusters.iter().filter(|c| !c.bound_met().all()) {
        let [a, b] = cluster.residuals;
        let square = |r: glam::DVec3| (cluster.weight_now() * r * r).element_sum();
        let sum = &mut sums[cluster.object as usize];
        sum.0 += square((a - b) * 0.5);
        sum.1 += square((a + b) * 0.5);
        sum.2 += 1.0;
    }
    sums.into_iter()
        .map(|(paths, all, count)| {
            let mean = all / f64::max(count, 1.0) * PRIOR_CLUSTERS;
            let fraction = Some((paths + 0.5 * mean) / (all + mean));
            fraction
                .filter(|f| f.is_finite())
                .map_or(0.0, |f| f.min(1.0))
        })
        .collect()
}

/// Distributes `total` paths over clusters: to objects in proportion to the square root of their pixels, which favours small
/// objects; at least one path per pixel and set.
pub fn distribute_paths(clusters: &mut [Cluster], objects: usize, total: u64) {
    let mut pixels = vec![0u64; objects];
    for cluster in clusters.iter() {
        pixels[cluster.object as usize] += cluster.pixels.len() as u64;
    }
    let sum: f64 = pixels.iter().map(|&n| (n as f64).sqrt()).sum();
    for cluster in clusters {
        let n = pixels[cluster.object as usize] as f64;
        // Half of the paths go to each set.
        let per_pixel = total as f64 * 0.5 / (sum * n.sqrt());
        cluster.paths = per_pixel.round().clamp(1.0, 4096.0) as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, Vec3};

    fn pixels(object: u32, count: u32) -> Cluster {
        Cluster::unit(object, count, Vec3::ZERO)
    }

    #[test]
    fn small_objects_get_more_paths_a_pixel_and_all_together_what_was_asked() {
        let mut clusters = vec![pixels(0, 5_000), pixels(0, 5_000), pixels(1, 100)];
        distribute_paths(&mut clusters, 2, 1_100_000);
        // Objects share as √10,000 to √100, half of it in each set.
        assert_eq!(clusters[0].paths, 50);
        assert_eq!(clusters[1].paths, 50);
        assert_eq!(clusters[2].paths, 500);
        let total: usize = (clusters.iter())
            .map(|c| 2 * c.pixels.len() * c.paths as usize)
            .sum();
        assert_eq!(total, 1_100_000);
    }

    #[test]
    fn every_pixel_gets_a_path_however_few_there_are() {
        for total in [0, 1, 1000] {
            let mut clusters = vec![pixels(0, 5_000), pixels(1, 1)];
            distribute_paths(&mut clusters, 3, total);
            assert!(clusters.iter().all(|c| c.paths >= 1));
        }
        distribute_paths(&mut [], 3, 100);
    }

    fn residuals(object: u32, a: f64, b: f64) -> Linearised {
        Linearised {
            residuals: [DVec3::splat(a), DVec3::splat(b)],
            ..Linearised::unit(object, DVec3::ZERO)
        }
    }

    #[test]
    fn residuals_that_both_sets_share_are_not_the_paths_and_opposite_ones_are() {
        let all: Vec<Linearised> = (0..100)
            .flat_map(|i| {
                let sign = [1.0, -1.0][i % 2];
                // Object 1: photograph noise 1, path noise 1 in each set, so half of it in their mean.
                [residuals(0, sign, sign), residuals(1, sign * 2.0, 0.0)]
            })
            .collect();
        let found = fractions(&all, 3);
        assert!(found[0] < 0.02, "{found:?}");
        assert!(found[1] > 0.95, "{found:?}");
        assert_eq!(found[2], 0.0);
    }
}
