//! Which objects give light, decided before anything is refined: every object is a reflector unless the photographs
//! contradict that plainly.

use super::PathCache;
use crate::inverse::parameters::Unknowns;
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// What an object is taken for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Role {
    /// Its light is what it reflects.
    Reflector,
    /// It gives light; its albedo is hidden by that and held at zero, so that its emission is its exitant radiance.
    Emitter,
    /// No photograph sees it. Its light is an unknown, found by what it does to others.
    Unseen,
    /// No photograph sees it, and nothing speaks for light from it.
    Dark,
    /// It both gives light and reflects.
    Glowing,
}

impl Role {
    /// Whether its albedo is fitted.
    pub fn reflects(self) -> bool {
        matches!(self, Self::Reflector | Self::Glowing)
    }

    /// Whether its emission is fitted.
    pub fn emits(self) -> bool {
        matches!(self, Self::Emitter | Self::Unseen | Self::Glowing)
    }
}

/// How many noise variances a squared error must exceed another's by to decide a role.
const DECISIVE: f64 = 25.0;

/// The parameters that are fitted under some roles: indices into albedos, then emissions.
pub fn free(roles: &[Role]) -> Vec<usize> {
    let albedo = (0..roles.len()).filter(|&k| roles[k].reflects());
    let emission = (0..roles.len())
        .filter(|&k| roles[k].emits())
        .map(|k| roles.len() + k);
    albedo.chain(emission).collect()
}

/// Chooses for each object between a reflector, as fitted in `reflecting`, and an emitter of one radiance, by the
/// squared error over its clusters.
pub fn choose(cache: &PathCache, reflecting: &Unknowns, seen: &[u64]) -> (Vec<Role>, Vec<Vec3>) {
    let objects = reflecting.surfaces();
    let residuals = cache.residuals(reflecting);

    // The weighted mean radiance of each object: what it emits if it is an emitter.
    let mut sums = vec![(DVec3::ZERO, DVec3::ZERO); objects];
    for cached in &cache.clusters {
        let (weight, measured) = (
            cached.cluster.weight.as_dvec3(),
            cached.cluster.measured.as_dvec3(),
        );
        let sum = &mut sums[cached.cluster.object as usize];
        sum.0 += weight * measured;
        sum.1 += weight;
    }
    let mean: Vec<DVec3> = sums
        .iter()
        .map(|&(wm, w)| {
            if w.min_element() > 0.0 {
                wm / w
            } else {
                DVec3::ZERO
            }
        })
        .collect();

    // Squared error of both hypotheses, and the typical one of a cluster.
    let mut advantage = vec![0.0; objects];
    let mut noise: Vec<f64> = Vec::with_capacity(residuals.len());
    for (cached, [a, b]) in cache.clusters.iter().zip(&residuals) {
        let object = cached.cluster.object as usize;
        let weight = cached.cluster.weight.as_dvec3();
        let emitting = cached.cluster.measured.as_dvec3() - mean[object];
        advantage[object] += (weight * (*a * *b - emitting * emitting)).element_sum();
        let both = (*a + *b) * 0.5;
        noise.push((weight * both * both).element_sum());
    }
    let middle = noise.len() / 2;
    let typical = if noise.is_empty() {
        0.0
    } else {
        *noise.select_nth_unstable_by(middle, f64::total_cmp).1
    };

    let roles = (0..objects)
        .map(|k| {
            match (
                seen[k],
                advantage[k] > DECISIVE * typical && mean[k].max_element() > 0.0,
            ) {
                (0, _) => Role::Unseen,
                (_, true) => Role::Emitter,
                (_, false) => Role::Reflector,
            }
        })
        .collect();
    (roles, mean.iter().map(|m| m.as_vec3()).collect())
}
