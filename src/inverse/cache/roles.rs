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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::cache::clusters::Cluster;
    use crate::inverse::cache::{CachedCluster, NO_LAMP, Vertex};

    /// A cluster of an object whose paths gather `light` with some noise and whose photograph shows `measured`.
    fn cluster(object: u32, index: usize, light: f32, measured: f32) -> CachedCluster {
        let path = |set: usize| Vertex {
            surface: object,
            lamp: NO_LAMP,
            lamp_weight: 0.0,
            emission_weight: 1.0,
            known: Vec3::splat(light * (1.0 + 0.02 * ((index * 7 + set * 3) % 5) as f32 - 0.04)),
        };
        CachedCluster {
            cluster: Cluster {
                frame: 0,
                object,
                pixels: vec![0],
                paths: 1,
                measured: Vec3::splat(measured),
                weight: Vec3::splat(1.0 / (measured * measured + 0.25)),
            },
            vertices: vec![path(0), path(1)],
            ends: vec![1, 2],
        }
    }

    /// A wall in uneven light that reflects 0.6, a lamp far brighter than what reaches it, an object that no pixel sees.
    fn room() -> PathCache {
        let mut cache = PathCache::default();
        for index in 0..40 {
            let light = 0.5 + 0.05 * index as f32;
            cache.clusters.push(cluster(0, index, light, 0.6 * light));
            cache.clusters.push(cluster(1, index, 0.3, 8.0));
        }
        cache
    }

    #[test]
    fn a_lamp_is_an_emitter_of_its_radiance_and_a_wall_a_reflector() {
        let mut reflecting = Unknowns::new(3);
        reflecting.albedo[0] = Vec3::splat(0.6);
        reflecting.albedo[1] = Vec3::ONE;
        let (roles, radiance) = choose(&room(), &reflecting, &[40, 40, 0]);
        assert_eq!(roles, [Role::Reflector, Role::Emitter, Role::Unseen]);
        assert!((radiance[1] - Vec3::splat(8.0)).length() < 1e-5);
        assert_eq!(free(&roles), [0, 3 + 1, 3 + 2]);
    }

    #[test]
    fn an_evenly_lit_wall_stays_a_reflector_though_one_radiance_would_explain_it_too() {
        let mut cache = PathCache::default();
        (0..40).for_each(|index| cache.clusters.push(cluster(0, index, 1.0, 0.6)));
        let mut reflecting = Unknowns::new(1);
        reflecting.albedo[0] = Vec3::splat(0.6);
        assert_eq!(choose(&cache, &reflecting, &[40]).0, [Role::Reflector]);
    }

    #[test]
    fn nothing_to_look_at_leaves_reflectors() {
        let roles = choose(&PathCache::default(), &Unknowns::new(2), &[5, 0]).0;
        assert_eq!(roles, [Role::Reflector, Role::Unseen]);
    }
}
