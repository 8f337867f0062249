//! Whether an object gives light or reflects it, judged by how well either explains the photographs of it.

use crate::inverse::paths::PathCache;
use crate::inverse::roles::Role;
use crate::inverse::unknowns::Unknowns;
use crate::math::stats::quantile;
use glam::{BVec3, DVec3, Vec3};

/// An advantage of so many typical squared errors decides.
const DECISIVE: f64 = 10.0;
/// How many standard deviations besides: of the noise of the paths, and of the advantage from cluster to cluster.
const SURE: [f64; 2] = [5.0, 2.0];
/// No single cluster counts for more than so many typical squared errors, however far its paths strayed.
const MOST: f64 = 400.0;
/// The noise of a cluster's paths counts in full up to so many times the usual one; beyond it the cluster counts for less.
const STRAYED: f64 = 4.0;
/// Turns of finding which lower bounds are exceeded.
const MAX_TURNS: usize = 8;
/// An emitter must leave at most this fraction of the squared error that a reflector leaves.
const EXPLAINED: f64 = 0.25;
/// What was taken for an emitter stays one down to this fraction of the advantage that it took to become one.
const STAYING: f64 = 0.2;

/// An object whose role should change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// Object index.
    pub object: usize,
    /// [`Role::Emitter`] or [`Role::Reflector`].
    pub role: Role,
    /// Its emission as an emitter, or its albedo as a reflector.
    pub value: Vec3,
}

/// A cluster seen as what its own object adds to it: `target` = albedo × `irradiance`, or emission × `shown`.
struct Part {
    weight: DVec3,
    /// Channels in which the target is a lower bound.
    censored: BVec3,
    target: [DVec3; 2],
    irradiance: [DVec3; 2],
    shown: [DVec3; 2],
}

/// Judges all seen reflectors and emitters, given a fit under their present roles.
pub fn classify(cache: &PathCache, unknowns: &Unknowns, roles: &[Role]) -> Vec<Change> {
    let mut parts = parts(cache, unknowns, roles);
    let classifications: Vec<Option<Classification>> =
        parts.iter().map(|p| Classification::new(p)).collect();

    // The typical error of a cluster, under whichever role explains it better; bounds that are kept have none.
    let measured = |part: &Part| !part.censored.any();
    let mut errors: Vec<f64> = (classifications.iter().zip(&parts))
        .filter_map(|(classification, parts)| {
            Some(classification.as_ref()?.errors.iter().zip(parts))
        })
        .flatten()
        .filter(|(_, part)| measured(part))
        .map(|(error, _)| *error)
        .collect();
    let typical = quantile(&mut errors, 0.5).unwrap_or(0.0);
    (parts.iter_mut().zip(classifications).enumerate())
        .filter_map(|(object, (parts, classification))| {
            classification?.steady(parts, typical);
            let classification = Classification::new(parts)?;
            let fraction = classification.fraction_of_decision(typical);
            match roles[object] {
                Role::Reflector if fraction > 1.0 => Some((Role::Emitter, classification.emission)),
                Role::Emitter if fraction < STAYING => {
                    Some((Role::Reflector, classification.albedo))
                }
                _ => None,
            }
            .map(|(role, value)| Change {
                object,
                role,
                value: value.as_vec3(),
            })
        })
        .collect()
}

/// The clusters of each surface, split into what the surface itself adds and the rest.
fn parts(cache: &PathCache, unknowns: &Unknowns, roles: &[Role]) -> Vec<Vec<Part>> {
    let surfaces = unknowns.surfaces();
    let judged = |k: usize| matches!(roles[k], Role::Reflector | Role::Emitter);
    let place: Vec<usize> = (0..2 * surfaces)
        .map(|i| if judged(i % surfaces) { i } else { usize::MAX })
        .collect();
    let mut parts: Vec<Vec<Part>> = (0..surfaces).map(|_| Vec::new()).collect();
    for cluster in cache.linearise(unknowns, &place, &[]) {
        let k = cluster.object as usize;
        if !judged(k) {
            continue;
        }
        let derivative = |parameter: usize| {
            let row = cluster.rows.iter().find(|r| r.0 == parameter);
            row.map_or([DVec3::ZERO; 2], |&(_, a, b)| [a, b])
        };
        let (irradiance, shown) = (derivative(k), derivative(surfaces + k));
        let (albedo, emission) = (
            unknowns.albedo[k].as_dvec3(),
            unknowns.emission[k].as_dvec3(),
        );
        parts[k].push(Part {
            weight: cluster.weight,
            censored: cluster.censored,
            target: std::array::from_fn(|set| {
                cluster.residuals[set] + albedo * irradiance[set] + emission * shown[set]
            }),
            irradiance,
            shown,
        });
    }
    parts
}

/// What an object would be as a reflector and as an emitter, and which explains its clusters better.
struct Classification {
    albedo: DVec3,
    emission: DVec3,
    /// Squared error as a reflector less that as an emitter, for each cluster.
    advantage: Vec<f64>,
    /// Variance of the above from the noise of the paths.
    noise: Vec<f64>,
    /// Squared error under the better role, for each cluster.
    errors: Vec<f64>,
    /// Sums of squared errors, as a reflector and as an emitter.
    sums: [f64; 2],
}

impl Classification {
    /// `None` where there is nothing to see.
    fn new(parts: &[Part]) -> Option<Self> {
        if parts.is_empty() {
            return None;
        }
        let albedo = least_squares(parts, |p| p.irradiance).clamp(DVec3::ZERO, DVec3::ONE);
        let emission = least_squares(parts, |p| p.shown).max(DVec3::ZERO);
        let errors = |left: &dyn Fn(&Part, usize) -> DVec3| -> Vec<[DVec3; 2]> {
            let wrong = |p: &Part| {
                let [a, b] = [left(p, 0), left(p, 1)];
                // What exceeds a lower bound is right.
                let bound_met = p.censored & (a + b).cmple(DVec3::ZERO);
                [a, b].map(|r| DVec3::select(bound_met, DVec3::ZERO, r))
            };
            parts.iter().map(wrong).collect()
        };
        let reflecting = errors(&|p, set| p.target[set] - albedo * p.irradiance[set]);
        let emitting = errors(&|p, set| p.target[set] - emission * p.shown[set]);
        let square = |weight: DVec3, [a, b]: [DVec3; 2]| (weight * a * b).element_sum();
        let sums = [&reflecting, &emitting].map(|all| {
            parts
                .iter()
                .zip(all)
                .map(|(p, &r)| square(p.weight, r))
                .sum()
        });
        let better = if sums[0] < sums[1] {
            &reflecting
        } else {
            &emitting
        };
        Some(Self {
            albedo,
            emission,
            advantage: (parts.iter().zip(reflecting.iter().zip(&emitting)))
                .map(|(p, (&r, &e))| square(p.weight, r) - square(p.weight, e))
                .collect(),
            noise: (parts.iter().zip(&reflecting))
                .map(|(p, &[a, b])| {
                    // The product of two residuals of mean r and path variance s² varies by 2 r² s² + s⁴.
                    let (both, paths) = ((a + b) * 0.5, (a - b) * (a - b) * 0.5);
                    (p.weight * p.weight * paths * (both * both * 2.0 + paths)).element_sum()
                })
                .collect(),
            errors: (parts.iter().zip(better))
                .map(|(p, &[a, b])| (p.weight * (a + b) * (a + b) * 0.25).element_sum())
                .collect(),
            sums,
        })
    }

    /// Takes weight from the clusters of which a few paths strayed far, so that they say no more than they know.
    fn steady(&self, parts: &mut [Part], typical: f64) {
        let usual = quantile(&mut self.noise.clone(), 0.5).unwrap_or(0.0) + typical * typical;
        for (part, noise) in parts.iter_mut().zip(&self.noise) {
            let most = usual * STRAYED;
            if *noise > most {
                part.weight *= (most / noise).sqrt();
            }
        }
    }

    /// The advantage of being an emitter as a fraction of what it takes to be sure of it.
    fn fraction_of_decision(&self, typical: f64) -> f64 {
        let [reflecting, emitting] = self.sums;
        if self.emission.max_element() <= 0.0 || emitting > EXPLAINED * reflecting {
            return 0.0;
        }
        let count = self.advantage.len() as f64;
        let most = MOST * typical;
        let bounded: Vec<f64> = self
            .advantage
            .iter()
            .map(|a| a.clamp(-most, most))
            .collect();
        let sum: f64 = bounded.iter().sum();
        let spread: f64 = bounded.iter().map(|a| (a - sum / count).powi(2)).sum();
        let noise: f64 = self.noise.iter().map(|n| n.min(most * most)).sum();
        let own = emitting.max(0.0) / count;
        let decisive =
            DECISIVE * typical.max(own) + SURE[0] * noise.sqrt() + SURE[1] * spread.sqrt();
        match (sum > 0.0, decisive > 0.0) {
            (true, true) => sum / decisive,
            (true, false) => f64::INFINITY,
            (false, _) => 0.0,
        }
    }
}

/// Weighted least squares of the targets on one regressor, unbiased by the noise of the paths. Targets that are lower bounds
/// count while what is found stays below them.
fn least_squares(parts: &[Part], regressor: impl Fn(&Part) -> [DVec3; 2]) -> DVec3 {
    let mut found = DVec3::ZERO;
    for turn in 0..MAX_TURNS {
        let (mut top, mut bottom) = (DVec3::ZERO, DVec3::ZERO);
        for part in parts {
            let [a, b] = regressor(part);
            let exceeded = (part.target[0] + part.target[1]).cmple(found * (a + b));
            // What was measured begins.
            let bound_met = part.censored & if turn == 0 { BVec3::TRUE } else { exceeded };
            let weight = DVec3::select(bound_met, DVec3::ZERO, part.weight);
            top += weight * (a * part.target[1] + b * part.target[0]) * 0.5;
            bottom += weight * a * b;
        }
        // Where all bounds are exceeded there is nothing left to change.
        let next = DVec3::select(bottom.cmpgt(DVec3::ZERO), top / bottom, found);
        if turn > 0 && next == found {
            break;
        }
        found = next;
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::paths::CachedCluster;
    use crate::inverse::paths::Vertex;
    use crate::inverse::paths::clusters::Cluster;

    /// A cluster of an object whose paths gather `light` with some noise and whose photograph shows `measured`.
    fn cluster(object: u32, index: usize, light: f32, measured: f32) -> CachedCluster {
        let path = |set: usize| Vertex {
            emission_weight: 1.0,
            known: Vec3::splat(light * (1.0 + 0.02 * ((index * 7 + set * 3) % 5) as f32 - 0.04)),
            ..Vertex::on(object)
        };
        CachedCluster {
            cluster: Cluster {
                frame: 0,
                object,
                pixels: vec![0],
                paths: 1,
                measured: Vec3::splat(measured),
                censored: BVec3::FALSE,
                weight: Vec3::splat(1.0 / (measured * measured + 0.25)),
                dark: Vec3::ONE,
            },
            vertices: vec![path(0), path(1)],
            ends: vec![1, 2],
        }
    }

    fn cache(clusters: impl Iterator<Item = CachedCluster>) -> PathCache {
        PathCache {
            clusters: clusters.collect(),
            ..Default::default()
        }
    }

    /// A wall in uneven light that reflects 0.6, a lamp far brighter than what reaches it, an object that no pixel sees.
    fn room() -> PathCache {
        cache((0..40).flat_map(|index| {
            let light = 0.5 + 0.05 * index as f32;
            [
                cluster(0, index, light, 0.6 * light),
                cluster(1, index, 0.3, 8.0),
            ]
        }))
    }

    #[test]
    fn a_lamp_becomes_an_emitter_of_its_radiance_and_a_wall_stays_a_reflector() {
        let mut unknowns = Unknowns::new(3);
        unknowns.albedo[0] = Vec3::splat(0.6);
        unknowns.albedo[1] = Vec3::ONE;
        let changes = classify(
            &room(),
            &unknowns,
            &[Role::Reflector, Role::Reflector, Role::Unseen],
        );
        assert_eq!(changes.len(), 1, "{changes:?}");
        assert_eq!((changes[0].object, changes[0].role), (1, Role::Emitter));
        assert!((changes[0].value - Vec3::splat(8.0)).length() < 1e-5);
    }

    /// One path of a thousand strays to a light so near that its cluster seems to receive a hundred times what it does: what
    /// the other clusters say still holds, for the lamp as for the wall.
    #[test]
    fn a_path_that_strays_decides_nothing() {
        let mut strayed = room();
        for object in 0..2 {
            let mut own = (strayed.clusters.iter_mut()).filter(|c| c.cluster.object == object);
            if let Some(cluster) = own.next() {
                cluster.vertices[0].known *= 100.0;
            }
        }
        let mut unknowns = Unknowns::new(2);
        unknowns.albedo = vec![Vec3::splat(0.6), Vec3::ONE];
        let changes = classify(&strayed, &unknowns, &[Role::Reflector; 2]);
        assert_eq!(changes.len(), 1, "{changes:?}");
        assert_eq!((changes[0].object, changes[0].role), (1, Role::Emitter));
        assert!((changes[0].value - Vec3::splat(8.0)).length() < 1e-5);
        unknowns.emission[1] = Vec3::splat(8.0);
        let settled = classify(&strayed, &unknowns, &[Role::Reflector, Role::Emitter]);
        assert_eq!(settled, []);
    }

    #[test]
    fn a_wall_taken_for_an_emitter_becomes_a_reflector_again_and_a_lamp_stays() {
        let mut unknowns = Unknowns::new(3);
        unknowns.emission[0] = Vec3::splat(0.9);
        unknowns.emission[1] = Vec3::splat(8.0);
        let changes = classify(
            &room(),
            &unknowns,
            &[Role::Emitter, Role::Emitter, Role::Unseen],
        );
        assert_eq!(changes.len(), 1, "{changes:?}");
        assert_eq!((changes[0].object, changes[0].role), (0, Role::Reflector));
        assert!((changes[0].value - Vec3::splat(0.6)).length() < 0.01);
    }

    #[test]
    fn an_evenly_lit_wall_stays_a_reflector_though_one_radiance_would_explain_it_too() {
        let cache = cache((0..40).map(|index| cluster(0, index, 1.0, 0.6)));
        let mut unknowns = Unknowns::new(1);
        unknowns.albedo[0] = Vec3::splat(0.6);
        assert_eq!(classify(&cache, &unknowns, &[Role::Reflector]), []);
    }

    /// Neither role explains stripes; that one fits a little better by chance decides nothing.
    #[test]
    fn a_textured_wall_stays_a_reflector() {
        let cache = cache((0..40).map(|index| {
            let light = [1.0, 0.9, 1.1][index % 3];
            let stripes = [0.2, 0.9, 0.3, 0.8, 0.25][index % 5];
            cluster(0, index, light, stripes * 0.9)
        }));
        let mut unknowns = Unknowns::new(1);
        unknowns.albedo[0] = Vec3::splat(0.5);
        assert_eq!(classify(&cache, &unknowns, &[Role::Reflector]), []);
    }

    /// Highlights saturate at 1: forty times the light of elsewhere falls on a wall that reflects 0.6.
    #[test]
    fn a_wall_with_saturated_highlights_stays_a_reflector_and_a_saturated_lamp_becomes_an_emitter()
    {
        let bound = |mut cached: CachedCluster| {
            cached.cluster.censored = BVec3::TRUE;
            cached
        };
        let wall = (0..40).map(|index| {
            let light = 0.5 + 0.02 * index as f32;
            cluster(0, index, light, 0.6 * light)
        });
        let highlights = (0..60).map(|index| bound(cluster(0, index, 40.0, 1.0)));
        let lamp = (0..60).map(|index| bound(cluster(1, index, 0.3, 1.0)));
        let mut unknowns = Unknowns::new(2);
        unknowns.albedo = vec![Vec3::splat(0.6), Vec3::ONE];
        let cache = cache(wall.chain(highlights).chain(lamp));
        let changes = classify(&cache, &unknowns, &[Role::Reflector; 2]);
        assert_eq!(changes.len(), 1, "{changes:?}");
        assert_eq!((changes[0].object, changes[0].role), (1, Role::Emitter));
        assert!((changes[0].value - Vec3::ONE).length() < 1e-5);
        // Brighter than its photographs, as its light asks for, it stays one.
        unknowns.albedo[1] = Vec3::ZERO;
        unknowns.emission[1] = Vec3::splat(8.0);
        let settled = classify(&cache, &unknowns, &[Role::Reflector, Role::Emitter]);
        assert_eq!(settled, []);
    }

    #[test]
    fn nothing_to_look_at_changes_nothing() {
        let roles = [Role::Reflector, Role::Unseen];
        assert_eq!(
            classify(&PathCache::default(), &Unknowns::new(2), &roles),
            []
        );
    }
}
