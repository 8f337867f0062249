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
    use glam::DVec3;

    /// A parameter that one round alone meets counts as zero in the others.
    #[test]
    fn the_mean_over_rounds_is_that_of_residuals_and_of_all_derivatives() {
        let round = |residuals: [f64; 2], rows: &[(usize, f64, f64)]| Linearised {
            residuals: residuals.map(DVec3::splat),
            own: DVec3::splat(rows[0].1),
            rows: (rows.iter())
                .map(|&(parameter, a, b)| (parameter, DVec3::splat(a), DVec3::splat(b)))
                .collect(),
            ..Linearised::unit(3, DVec3::ZERO)
        };
        let mut sums = Accumulated::default();
        sums.add(vec![round([1.0, 3.0], &[(2, 1.0, 5.0), (7, 4.0, 2.0)])]);
        sums.add(vec![round([5.0, 1.0], &[(2, 3.0, 1.0), (4, 6.0, 8.0)])]);
        assert_eq!(sums.rounds(), 2);
        let wanted = round([3.0, 2.0], &[(2, 2.0, 3.0), (4, 3.0, 4.0), (7, 2.0, 1.0)]);
        let [found] = &sums.mean()[..] else {
            panic!("there is one cluster");
        };
        assert_eq!(found.residuals, wanted.residuals);
        assert_eq!(found.rows, wanted.rows);
        assert_eq!(found.own, DVec3::splat(2.0));
        assert_eq!(found.object, 3);
    }
}
