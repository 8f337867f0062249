//! Sums linearised clusters over rounds of paths, so that the paths need not be kept.

use crate::inverse::paths::evaluate::Linearised;

/// Sums of linearised clusters over rounds of independent paths.
#[derive(Debug, Clone, Default)]
pub struct Accumulated {
    clusters: Vec<Linearised>,
    rounds: u32,
}

impl Accumulated {
    /// Adds a round with the same clusters, linearised about the same unknowns, as the previous rounds.
    pub fn add(&mut self, round: Vec<Linearised>) {
        self.rounds += 1;
        if self.clusters.is_empty() {
            self.clusters = round;
            self.clusters
                .iter_mut()
                .for_each(|c| c.rows.sort_unstable_by_key(|r| r.0));
            return;
        }
        for (sum, new) in self.clusters.iter_mut().zip(round) {
            for set in 0..2 {
                sum.residuals[set] += new.residuals[set];
            }
            sum.own += new.own;
            for (parameter, a, b) in new.rows {
                match sum.rows.binary_search_by_key(&parameter, |r| r.0) {
                    Ok(at) => {
                        sum.rows[at].1 += a;
                        sum.rows[at].2 += b;
                    }
                    Err(at) => sum.rows.insert(at, (parameter, a, b)),
                }
            }
        }
    }

    /// Number of rounds added.
    pub fn rounds(&self) -> u32 {
        self.rounds
    }

    /// The mean over rounds of each cluster.
    pub fn mean(&self) -> Vec<Linearised> {
        let scale = 1.0 / f64::from(self.rounds.max(1));
        self.clusters
            .iter()
            .map(|c| Linearised {
                residuals: c.residuals.map(|r| r * scale),
                own: c.own * scale,
                rows: (c.rows.iter())
                    .map(|&(parameter, a, b)| (parameter, a * scale, b * scale))
                    .collect(),
                ..*c
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::fit::equations::{Coupling, NormalEquations};
    use crate::inverse::fit::prior::Prior;
    use crate::inverse::fit::robust_weights::RobustWeights;
    use crate::inverse::paths::clusters::Cluster;
    use crate::inverse::paths::{CachedCluster, PathCache, Vertex};
    use crate::inverse::unknowns::Unknowns;
    use crate::math::rng::Stream;
    use glam::Vec3;

    const SURFACES: usize = 3;
    const PIXELS: usize = 2;
    const PATHS: usize = 2;
    const ROUNDS: usize = 3;

    /// One cluster with the given paths for each pixel and set.
    fn cache(paths: impl Fn(usize, usize) -> Vec<Vec<Vertex>>) -> PathCache {
        let (mut vertices, mut ends, mut count) = (Vec::new(), Vec::new(), 0);
        for (pixel, set) in (0..PIXELS).flat_map(|p| [(p, 0), (p, 1)]) {
            let paths = paths(pixel, set);
            count = paths.len() as u32;
            for path in paths {
                vertices.extend(path);
                ends.push(vertices.len() as u32);
            }
        }
        let cluster = Cluster {
            paths: count,
            weight: Vec3::new(1.0, 2.0, 3.0),
            ..Cluster::unit(0, PIXELS as u32, Vec3::new(0.5, 0.6, 0.7))
        };
        PathCache::from(vec![CachedCluster {
            cluster,
            vertices,
            ends,
        }])
    }

    /// The paths of one round through a pixel, of one set.
    fn round(round: usize, pixel: usize, set: usize) -> Vec<Vec<Vertex>> {
        (0..PATHS)
            .map(|path| {
                let key = ((round * PIXELS + pixel) * 2 + set) * PATHS + path;
                Vertex::random_path(SURFACES, &mut Stream::new(51, 0, 0, key as u64))
            })
            .collect()
    }

    #[test]
    fn rounds_add_up_to_the_normal_equations_of_all_their_paths() {
        let unknowns = Unknowns {
            albedo: vec![Vec3::new(0.3, 0.5, 0.8); SURFACES],
            emission: vec![Vec3::new(1.0, 2.0, 0.5); SURFACES],
        };
        // All but one parameter are free.
        let free: Vec<usize> = (0..2 * SURFACES).filter(|&p| p != 4).collect();
        let mut row_of = vec![usize::MAX; 2 * SURFACES];
        (free.iter().enumerate()).for_each(|(row, &p)| row_of[p] = row);

        let mut sums = Accumulated::default();
        for r in 0..ROUNDS {
            let cache = cache(|pixel, set| round(r, pixel, set));
            sums.add(cache.linearise(&unknowns, &row_of, &[]));
        }
        assert_eq!(sums.rounds(), ROUNDS as u32);
        let even = RobustWeights::even(SURFACES);
        let prior = Prior::new(SURFACES, SURFACES, Vec3::ONE);
        let found = NormalEquations::new(&sums.mean(), free.len(), &even, &prior);
        let together = cache(|pixel, set| (0..ROUNDS).flat_map(|r| round(r, pixel, set)).collect());
        let wanted = together.normal_equations(&unknowns, &free, &even, &prior);

        assert_eq!(found.clusters, wanted.clusters);
        assert!((found.objective - wanted.objective).length() < 1e-5);
        let (Coupling::Dense(found_both), Coupling::Dense(wanted_both)) =
            (&found.coupling, &wanted.coupling)
        else {
            panic!("so few parameters have matrices");
        };
        for c in 0..3 {
            for (found, wanted) in [
                (&found_both.hessian[c], &wanted_both.hessian[c]),
                (&found_both.scatter()[c], &wanted_both.scatter()[c]),
            ] {
                assert!(wanted.amax() > 0.0);
                assert!((found - wanted).amax() < 1e-5 * wanted.amax());
            }
        }
        let size = wanted
            .descent
            .iter()
            .map(|d| d.length())
            .fold(0.0, f64::max);
        for (found, wanted) in found.descent.iter().zip(&wanted.descent) {
            assert!((*found - *wanted).length() < 1e-5 * size);
        }
    }
}
