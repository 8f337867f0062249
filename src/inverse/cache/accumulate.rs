//! Rounds of paths added up without keeping them: linearised about one point, averaged cluster by cluster.

use super::evaluate::{Linearised, NormalEquations};
use glam::DVec3;

/// Sums of linearised clusters over rounds of independent paths.
#[derive(Debug, Clone, Default)]
pub struct Accumulated {
    clusters: Vec<Linearised>,
    rounds: u32,
}

impl Accumulated {
    /// Adds a round, linearised about the same unknowns, with the same clusters, as those before.
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
            for (place, a, b) in new.rows {
                match sum.rows.binary_search_by_key(&place, |r| r.0) {
                    Ok(at) => {
                        sum.rows[at].1 += a;
                        sum.rows[at].2 += b;
                    }
                    Err(at) => sum.rows.insert(at, (place, a, b)),
                }
            }
        }
    }

    /// Rounds so far.
    pub fn rounds(&self) -> u32 {
        self.rounds
    }

    /// The normal equations of the mean over rounds, with `n` rows.
    pub fn equations(&self, n: usize) -> NormalEquations {
        let scale = 1.0 / f64::from(self.rounds.max(1));
        let mean: Vec<Linearised> = self
            .clusters
            .iter()
            .map(|c| Linearised {
                weight: c.weight,
                residuals: c.residuals.map(|r: DVec3| r * scale),
                rows: c
                    .rows
                    .iter()
                    .map(|&(place, a, b)| (place, a * scale, b * scale))
                    .collect(),
            })
            .collect();
        NormalEquations::new(&mean, n)
    }
}
