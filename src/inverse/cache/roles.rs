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

/// How many standard deviations of the paths' noise besides.
const SURE: f64 = 5.0;

/// Roles chosen from photographs.
#[derive(Debug, Clone)]
pub struct Choice {
    /// One a surface.
    pub roles: Vec<Role>,
    /// What each emits if it is an emitter.
    pub radiance: Vec<Vec3>,
}

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
pub fn choose(cache: &PathCache, reflecting: &Unknowns, seen: &[u64]) -> Choice {
    let residuals = cache.residuals(reflecting);
    let radiance = mean_radiance(cache, reflecting.surfaces());
    let emits = plainly_emits(cache, &residuals, &radiance);
    let roles = emits
        .iter()
        .enumerate()
        .map(
            |(k, &emits)| match (seen.get(k).copied().unwrap_or(0), emits) {
                (0, _) => Role::Unseen,
                (_, true) => Role::Emitter,
                (_, false) => Role::Reflector,
            },
        )
        .collect();
    Choice {
        roles,
        radiance: radiance.iter().map(|m| m.as_vec3()).collect(),
    }
}

/// The emitters that would do as well as reflectors in the light of all the others, with the albedo they would have.
pub fn doubtful(cache: &PathCache, unknowns: &Unknowns, roles: &[Role]) -> Vec<(usize, Vec3)> {
    let surfaces = unknowns.surfaces();
    let place: Vec<usize> = (0..2 * surfaces)
        .map(|i| {
            if i < surfaces && roles[i] == Role::Emitter {
                i
            } else {
                usize::MAX
            }
        })
        .collect();
    let linearised = cache.linearise(unknowns, &place);

    // With no albedo of its own, an emitter's derivative is the light that it receives: fit its photographs to that.
    let received = |cluster: usize, k: usize| {
        let row = linearised[cluster].rows.iter().find(|r| r.0 == k);
        row.map_or([DVec3::ZERO; 2], |&(_, a, b)| [a, b])
    };
    let mut sums = vec![(DVec3::ZERO, DVec3::ZERO); surfaces];
    for (index, cached) in cache.clusters.iter().enumerate() {
        let k = cached.cluster.object as usize;
        if roles[k] == Role::Emitter {
            let (weight, [a, b]) = (cached.cluster.weight.as_dvec3(), received(index, k));
            sums[k].0 += weight * (a + b) * 0.5 * cached.cluster.measured.as_dvec3();
            sums[k].1 += weight * a * b;
        }
    }
    let albedo: Vec<DVec3> = sums
        .iter()
        .map(|&(top, bottom)| {
            (top / bottom.max(DVec3::splat(f64::MIN_POSITIVE))).clamp(DVec3::ZERO, DVec3::ONE)
        })
        .collect();
    let residuals: Vec<[DVec3; 2]> = (cache.clusters.iter().enumerate())
        .map(|(index, cached)| {
            let k = cached.cluster.object as usize;
            if roles[k] == Role::Emitter {
                received(index, k)
                    .map(|light| cached.cluster.measured.as_dvec3() - albedo[k] * light)
            } else {
                linearised[index].residuals
            }
        })
        .collect();
    let emits = plainly_emits(cache, &residuals, &mean_radiance(cache, surfaces));
    (0..surfaces)
        .filter(|&k| roles[k] == Role::Emitter && !emits[k])
        .map(|k| (k, albedo[k].as_vec3()))
        .collect()
}

/// The weighted mean radiance of each surface: what it emits if it is an emitter.
fn mean_radiance(cache: &PathCache, surfaces: usize) -> Vec<DVec3> {
    let mut sums = vec![(DVec3::ZERO, DVec3::ZERO); surfaces];
    for cached in &cache.clusters {
        let weight = cached.cluster.weight.as_dvec3();
        let sum = &mut sums[cached.cluster.object as usize];
        sum.0 += weight * cached.cluster.measured.as_dvec3();
        sum.1 += weight;
    }
    let mean = |(top, bottom): (DVec3, DVec3)| {
        if bottom.min_element() > 0.0 {
            top / bottom
        } else {
            DVec3::ZERO
        }
    };
    sums.into_iter().map(mean).collect()
}

/// For each surface, whether one emitted radiance explains its clusters plainly better than what it would reflect,
/// given the residuals of the latter.
fn plainly_emits(cache: &PathCache, reflecting: &[[DVec3; 2]], radiance: &[DVec3]) -> Vec<bool> {
    let mut advantage = vec![0.0; radiance.len()];
    let mut doubt = vec![0.0f64; radiance.len()];
    let mut errors: Vec<f64> = Vec::with_capacity(reflecting.len());
    for (cached, [a, b]) in cache.clusters.iter().zip(reflecting) {
        let k = cached.cluster.object as usize;
        let weight = cached.cluster.weight.as_dvec3();
        let emitting = cached.cluster.measured.as_dvec3() - radiance[k];
        advantage[k] += (weight * (*a * *b - emitting * emitting)).element_sum();
        // The product of two residuals of mean r and path variance s² varies by 2 r² s² + s⁴.
        let both = (*a + *b) * 0.5;
        let paths = (*a - *b) * (*a - *b) * 0.5;
        doubt[k] += (weight * weight * paths * (both * both * 2.0 + paths)).element_sum();
        errors.push((weight * both * both).element_sum());
    }
    let middle = errors.len() / 2;
    let typical = if errors.is_empty() {
        0.0
    } else {
        *errors.select_nth_unstable_by(middle, f64::total_cmp).1
    };
    (0..radiance.len())
        .map(|k| {
            let threshold = DECISIVE * typical + SURE * doubt[k].sqrt();
            advantage[k] > threshold && radiance[k].max_element() > 0.0
        })
        .collect()
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
        let Choice { roles, radiance } = choose(&room(), &reflecting, &[40, 40, 0]);
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
        assert_eq!(choose(&cache, &reflecting, &[40]).roles, [Role::Reflector]);
    }

    #[test]
    fn nothing_to_look_at_leaves_reflectors() {
        let roles = choose(&PathCache::default(), &Unknowns::new(2), &[5, 0]).roles;
        assert_eq!(roles, [Role::Reflector, Role::Unseen]);
    }
}
