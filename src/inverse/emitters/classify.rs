//! Classifies each object as emitter or reflector: by which of the two explains its photographs better.

use crate::inverse::paths::PathCache;
use crate::inverse::roles::Role;
use crate::inverse::unknowns::Unknowns;
use crate::math::color::luminance;
use crate::math::stats::quantile;
use glam::{BVec3, DVec3, Vec3};

/// Least advantage of an emitter, in typical squared errors of a cluster.
const MIN_ADVANTAGE: f64 = 10.0;
/// Additional advantage in standard deviations: of path noise, and of the advantage over clusters.
const SIGNIFICANT: [f64; 2] = [5.0, 2.0];
/// Limit of a single cluster's advantage, in typical squared errors, against outlier paths.
const MAX_ADVANTAGE: f64 = 400.0;
/// Clusters with more than this many times the median path noise are down-weighted to it.
const MAX_NOISE: f64 = 4.0;
/// Greatest number of iterations over which lower bounds are active.
const MAX_ITERATIONS: usize = 8;
/// Greatest squared error of an emitter, as a fraction of that of a reflector.
const EXPLAINED: f64 = 0.25;
/// Hysteresis: an emitter stays one down to this fraction of the advantage needed to become one.
const HYSTERESIS: f64 = 0.2;

/// Least albedo that an emitter of a scan would need as a reflector, unless its photographs are saturated. The light of windows and
/// holes is missing while lamps are told from walls, and dim surfaces that need a little more than an albedo of one are white walls.
/// `relit trade --rooms 1 --seed N --family scanned --preset preview` with N of 1, 4, 7, 11, 14 and 19 has a mean albedo error of 0.185
/// without such a limit, 0.125 with 2 or 3, and 0.130 with 5. In the other rooms up to 24 this limit changes at most 0.002.
const MIN_NEEDED_ALBEDO: f32 = 3.0;

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

/// A cluster's radiance due to its own object, from both sets of paths: `target` = albedo × `irradiance`, or emission × `coverage`.
struct OwnRadiance {
    /// At the photographed radiance, so that neither role is favoured by being the present one.
    weight: DVec3,
    /// Channels in which the target is a lower bound.
    censored: BVec3,
    target: [DVec3; 2],
    irradiance: [DVec3; 2],
    coverage: [DVec3; 2],
}

/// Classifies all seen reflectors and emitters, given a fit under their present roles; returns the roles to change. Dim objects of a
/// `scanned` mesh are reflectors.
pub fn classify(
    cache: &PathCache,
    unknowns: &Unknowns,
    roles: &[Role],
    scanned: bool,
) -> Vec<Change> {
    let mut clusters = own_radiance(cache, unknowns, roles);
    let models: Vec<Option<RoleModels>> = clusters.iter().map(|c| RoleModels::new(c)).collect();

    // The typical error of an uncensored cluster under the better role.
    let mut errors: Vec<f64> = (models.iter().zip(&clusters))
        .filter_map(|(models, clusters)| Some(models.as_ref()?.errors.iter().zip(clusters)))
        .flatten()
        .filter(|(_, cluster)| !cluster.censored.any())
        .map(|(error, _)| *error)
        .collect();
    let typical = quantile(&mut errors, 0.5).unwrap_or(0.0);
    (clusters.iter_mut().zip(models).enumerate())
        .filter_map(|(object, (clusters, models))| {
            models?.limit_noise(clusters, typical);
            let models = RoleModels::new(clusters)?;
            let advantage = match scanned && models.is_dim(clusters) {
                true => 0.0,
                false => models.relative_advantage(typical),
            };
            match roles[object] {
                Role::Reflector if advantage > 1.0 => Some((Role::Emitter, models.emission)),
                Role::Emitter if advantage < HYSTERESIS => Some((Role::Reflector, models.albedo)),
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

/// The least emission of each surface that explains its photographs, where saturated ones are lower bounds; `None` for surfaces
/// without photographs or whose role is settled otherwise.
pub fn least_emission(cache: &PathCache, unknowns: &Unknowns, roles: &[Role]) -> Vec<Option<Vec3>> {
    let least = |clusters: &Vec<OwnRadiance>| Some(RoleModels::new(clusters)?.emission.as_vec3());
    (own_radiance(cache, unknowns, roles).iter())
        .map(least)
        .collect()
}

/// For each surface, its clusters' [`OwnRadiance`].
fn own_radiance(cache: &PathCache, unknowns: &Unknowns, roles: &[Role]) -> Vec<Vec<OwnRadiance>> {
    let surfaces = unknowns.surfaces();
    let is_classified = |k: usize| matches!(roles[k], Role::Reflector | Role::Emitter);
    let row_of: Vec<usize> = (0..2 * surfaces)
        .map(|i| match is_classified(i % surfaces) {
            true => i,
            false => usize::MAX,
        })
        .collect();
    let mut own: Vec<Vec<OwnRadiance>> = (0..surfaces).map(|_| Vec::new()).collect();
    let linearised = cache.linearise(unknowns, &row_of, &[]);
    for (cached, cluster) in cache.clusters.iter().zip(linearised) {
        let k = cluster.object as usize;
        if !is_classified(k) {
            continue;
        }
        let derivative = |parameter: usize| {
            let row = cluster.rows.iter().find(|r| r.0 == parameter);
            row.map_or([DVec3::ZERO; 2], |&(_, a, b)| [a, b])
        };
        let (irradiance, coverage) = (derivative(k), derivative(surfaces + k));
        let (albedo, emission) = (
            unknowns.albedo[k].as_dvec3(),
            unknowns.emission[k].as_dvec3(),
        );
        own[k].push(OwnRadiance {
            weight: cached.cluster.weight(cached.cluster.measured.as_dvec3()),
            censored: cluster.censored,
            target: std::array::from_fn(|set| {
                cluster.residuals[set] + albedo * irradiance[set] + emission * coverage[set]
            }),
            irradiance,
            coverage,
        });
    }
    own
}

/// Least-squares models of an object as a reflector and as an emitter, with their errors.
struct RoleModels {
    /// The albedo that would explain the photographs; may exceed one.
    needed_albedo: DVec3,
    /// The same, within 0 and 1.
    albedo: DVec3,
    emission: DVec3,
    /// For each cluster, squared error as a reflector minus squared error as an emitter.
    advantage: Vec<f64>,
    /// Variance of the advantage by path noise, for each cluster.
    noise: Vec<f64>,
    /// Squared error under the better role, for each cluster.
    errors: Vec<f64>,
    /// Sums of squared errors, as a reflector and as an emitter.
    sums: [f64; 2],
}

impl RoleModels {
    fn new(clusters: &[OwnRadiance]) -> Option<Self> {
        if clusters.is_empty() {
            return None;
        }
        let needed_albedo = least_squares(clusters, |c| c.irradiance);
        let albedo = needed_albedo.clamp(DVec3::ZERO, DVec3::ONE);
        let emission = least_squares(clusters, |c| c.coverage).max(DVec3::ZERO);
        let residuals = |residual: &dyn Fn(&OwnRadiance, usize) -> DVec3| -> Vec<[DVec3; 2]> {
            let censored = |c: &OwnRadiance| {
                let [a, b] = [residual(c, 0), residual(c, 1)];
                // A model above a lower bound has no residual.
                let bound_met = c.censored & (a + b).cmple(DVec3::ZERO);
                [a, b].map(|r| DVec3::select(bound_met, DVec3::ZERO, r))
            };
            clusters.iter().map(censored).collect()
        };
        let reflecting = residuals(&|c, set| c.target[set] - albedo * c.irradiance[set]);
        let emitting = residuals(&|c, set| c.target[set] - emission * c.coverage[set]);
        let square = |weight: DVec3, [a, b]: [DVec3; 2]| (weight * a * b).element_sum();
        let sums = [&reflecting, &emitting].map(|residuals| {
            (clusters.iter().zip(residuals))
                .map(|(c, &r)| square(c.weight, r))
                .sum()
        });
        let better = if sums[0] < sums[1] {
            &reflecting
        } else {
            &emitting
        };
        Some(Self {
            needed_albedo,
            albedo,
            emission,
            advantage: (clusters.iter().zip(reflecting.iter().zip(&emitting)))
                .map(|(c, (&r, &e))| square(c.weight, r) - square(c.weight, e))
                .collect(),
            noise: (clusters.iter().zip(&reflecting))
                .map(|(c, &[a, b])| {
                    // The product of two residuals of mean r and path variance s² has the variance 2 r² s² + s⁴.
                    let (mean, variance) = ((a + b) * 0.5, (a - b) * (a - b) * 0.5);
                    let product = variance * (mean * mean * 2.0 + variance);
                    (c.weight * c.weight * product).element_sum()
                })
                .collect(),
            errors: (clusters.iter().zip(better))
                .map(|(c, &[a, b])| (c.weight * (a + b) * (a + b) * 0.25).element_sum())
                .collect(),
            sums,
        })
    }

    /// Reduces the weight of clusters with high path noise to the limit of [`MAX_NOISE`].
    fn limit_noise(&self, clusters: &mut [OwnRadiance], typical: f64) {
        let usual = quantile(&mut self.noise.clone(), 0.5).unwrap_or(0.0) + typical * typical;
        let max = usual * MAX_NOISE;
        for (cluster, noise) in clusters.iter_mut().zip(&self.noise) {
            if *noise > max {
                cluster.weight *= (max / noise).sqrt();
            }
        }
    }

    /// Whether most photographs show less than [`MIN_NEEDED_ALBEDO`] would reflect, and are not saturated.
    fn is_dim(&self, clusters: &[OwnRadiance]) -> bool {
        let saturated = clusters.iter().filter(|c| c.censored.any()).count();
        luminance(self.needed_albedo.as_vec3()) < MIN_NEEDED_ALBEDO
            && 2 * saturated < clusters.len()
    }

    /// The advantage of an emitter over a reflector, as a fraction of the advantage needed to decide for it.
    fn relative_advantage(&self, typical: f64) -> f64 {
        let [reflecting, emitting] = self.sums;
        if self.emission.max_element() <= 0.0 || emitting > EXPLAINED * reflecting {
            return 0.0;
        }
        let count = self.advantage.len() as f64;
        let max = MAX_ADVANTAGE * typical;
        let bounded: Vec<f64> = (self.advantage.iter())
            .map(|a| a.clamp(-max, max))
            .collect();
        let sum: f64 = bounded.iter().sum();
        let spread: f64 = bounded.iter().map(|a| (a - sum / count).powi(2)).sum();
        let noise: f64 = self.noise.iter().map(|n| n.min(max * max)).sum();
        let own = emitting.max(0.0) / count;
        let needed = MIN_ADVANTAGE * typical.max(own)
            + SIGNIFICANT[0] * noise.sqrt()
            + SIGNIFICANT[1] * spread.sqrt();
        match (sum > 0.0, needed > 0.0) {
            (true, true) => sum / needed,
            (true, false) => f64::INFINITY,
            (false, _) => 0.0,
        }
    }
}

/// Weighted least squares of the targets on one regressor, unbiased by path noise. Censored targets count only while the
/// solution is below them; the first iteration uses uncensored ones alone.
fn least_squares(
    clusters: &[OwnRadiance],
    regressor: impl Fn(&OwnRadiance) -> [DVec3; 2],
) -> DVec3 {
    let mut solution = DVec3::ZERO;
    for iteration in 0..MAX_ITERATIONS {
        let (mut numerator, mut denominator) = (DVec3::ZERO, DVec3::ZERO);
        for cluster in clusters {
            let [a, b] = regressor(cluster);
            let exceeded = (cluster.target[0] + cluster.target[1]).cmple(solution * (a + b));
            let bound_met = match iteration {
                0 => cluster.censored,
                _ => cluster.censored & exceeded,
            };
            let weight = DVec3::select(bound_met, DVec3::ZERO, cluster.weight);
            numerator += weight * (a * cluster.target[1] + b * cluster.target[0]) * 0.5;
            denominator += weight * a * b;
        }
        // The solution stays where all bounds are met.
        let is_determined = denominator.cmpgt(DVec3::ZERO);
        let next = DVec3::select(is_determined, numerator / denominator, solution);
        if iteration > 0 && next == solution {
            break;
        }
        solution = next;
    }
    solution
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::paths::clusters::Cluster;
    use crate::inverse::paths::{CachedCluster, Vertex};

    /// A cluster whose paths have the incident radiance `light`, with some noise, and whose photograph shows `measured`.
    fn cluster(object: u32, index: usize, light: f32, measured: f32) -> CachedCluster {
        let path = |set: usize| Vertex {
            emission_weight: 1.0,
            known: Vec3::splat(light * (1.0 + 0.02 * ((index * 7 + set * 3) % 5) as f32 - 0.04)),
            ..Vertex::on(object)
        };
        CachedCluster {
            cluster: Cluster {
                level: Some(Vec3::splat(measured)),
                dark: Vec3::splat(0.5),
                ..Cluster::unit(object, 1, Vec3::splat(measured))
            },
            vertices: vec![path(0), path(1)],
            ends: vec![1, 2],
        }
    }

    fn saturated(mut cached: CachedCluster) -> CachedCluster {
        cached.cluster.censored = BVec3::TRUE;
        cached
    }

    fn cache(clusters: impl Iterator<Item = CachedCluster>) -> PathCache {
        PathCache::from(clusters.collect::<Vec<_>>())
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
        let unknowns = Unknowns::grey([0.6, 1.0, 0.5], [0.0; 3]);
        let roles = [Role::Reflector, Role::Reflector, Role::Unseen];
        let changes = classify(&room(), &unknowns, &roles, false);
        assert_eq!(changes.len(), 1, "{changes:?}");
        assert_eq!((changes[0].object, changes[0].role), (1, Role::Emitter));
        assert!((changes[0].value - Vec3::splat(8.0)).length() < 1e-5);
    }

    /// One outlier path makes its cluster seem to receive a hundred times its irradiance; the other clusters still decide.
    #[test]
    fn a_path_that_strays_decides_nothing() {
        let mut strayed = room();
        for object in 0..2 {
            let mut own = (strayed.clusters.iter_mut()).filter(|c| c.cluster.object == object);
            if let Some(cluster) = own.next() {
                cluster.vertices[0].known *= 100.0;
            }
        }
        let mut unknowns = Unknowns::grey([0.6, 1.0], [0.0; 2]);
        let changes = classify(&strayed, &unknowns, &[Role::Reflector; 2], false);
        assert_eq!(changes.len(), 1, "{changes:?}");
        assert_eq!((changes[0].object, changes[0].role), (1, Role::Emitter));
        assert!((changes[0].value - Vec3::splat(8.0)).length() < 1e-5);
        unknowns.emission[1] = Vec3::splat(8.0);
        let settled = classify(
            &strayed,
            &unknowns,
            &[Role::Reflector, Role::Emitter],
            false,
        );
        assert_eq!(settled, []);
    }

    #[test]
    fn a_wall_taken_for_an_emitter_becomes_a_reflector_again_and_a_lamp_stays() {
        let unknowns = Unknowns::grey([0.5; 3], [0.9, 8.0, 0.0]);
        let roles = [Role::Emitter, Role::Emitter, Role::Unseen];
        let changes = classify(&room(), &unknowns, &roles, false);
        assert_eq!(changes.len(), 1, "{changes:?}");
        assert_eq!((changes[0].object, changes[0].role), (0, Role::Reflector));
        assert!((changes[0].value - Vec3::splat(0.6)).length() < 0.01);
    }

    #[test]
    fn an_evenly_lit_wall_stays_a_reflector_though_one_radiance_would_explain_it_too() {
        let cache = cache((0..40).map(|index| cluster(0, index, 1.0, 0.6)));
        let unknowns = Unknowns::grey([0.6], [0.0]);
        assert_eq!(classify(&cache, &unknowns, &[Role::Reflector], false), []);
    }

    /// A white wall of a scan, in light of which about half is missing, and in the same light a lamp and a saturated window.
    #[test]
    fn a_wall_of_a_scan_in_too_little_light_stays_a_reflector_and_a_lamp_becomes_an_emitter() {
        let cache = cache((0..40).flat_map(|index| {
            let light = 0.8 + 0.01 * index as f32;
            let uneven = [1.0, 0.97, 1.03][index % 3];
            [
                cluster(0, index, light, 2.0 * uneven),
                cluster(1, index, light, 20.0 * uneven),
                saturated(cluster(2, index, 1.0, 2.0)),
            ]
        }));
        let unknowns = Unknowns::grey([1.0; 3], [0.0; 3]);
        let emitters = |scanned: bool| -> Vec<usize> {
            let changes = classify(&cache, &unknowns, &[Role::Reflector; 3], scanned);
            changes.iter().map(|change| change.object).collect()
        };
        assert_eq!(emitters(true), [1, 2]);
        assert_eq!(emitters(false), [0, 1, 2]);
        // A wall that was taken for an emitter becomes a reflector.
        let unknowns = Unknowns::grey([0.0, 1.0, 1.0], [2.0, 0.0, 0.0]);
        let roles = [Role::Emitter, Role::Reflector, Role::Reflector];
        let changes = classify(&cache, &unknowns, &roles, true);
        let reflector = Change {
            object: 0,
            role: Role::Reflector,
            value: Vec3::ONE,
        };
        assert!(changes.contains(&reflector), "{changes:?}");
    }

    /// Neither role explains stripes; a small advantage by chance decides nothing.
    #[test]
    fn a_textured_wall_stays_a_reflector() {
        let cache = cache((0..40).map(|index| {
            let light = [1.0, 0.9, 1.1][index % 3];
            let stripes = [0.2, 0.9, 0.3, 0.8, 0.25][index % 5];
            cluster(0, index, light, stripes * 0.9)
        }));
        let unknowns = Unknowns::grey([0.5], [0.0]);
        assert_eq!(classify(&cache, &unknowns, &[Role::Reflector], false), []);
    }

    /// Highlights saturate at 1: forty times the light of elsewhere falls on a wall that reflects 0.6.
    #[test]
    fn a_wall_with_saturated_highlights_stays_a_reflector_and_a_saturated_lamp_becomes_an_emitter()
    {
        let wall = (0..40).map(|index| {
            let light = 0.5 + 0.02 * index as f32;
            cluster(0, index, light, 0.6 * light)
        });
        let highlights = (0..60).map(|index| saturated(cluster(0, index, 40.0, 1.0)));
        let lamp = (0..60).map(|index| saturated(cluster(1, index, 0.3, 1.0)));
        let mut unknowns = Unknowns::grey([0.6, 1.0], [0.0; 2]);
        let cache = cache(wall.chain(highlights).chain(lamp));
        let changes = classify(&cache, &unknowns, &[Role::Reflector; 2], false);
        assert_eq!(changes.len(), 1, "{changes:?}");
        assert_eq!((changes[0].object, changes[0].role), (1, Role::Emitter));
        assert!((changes[0].value - Vec3::ONE).length() < 1e-5);
        let roles = [Role::Glowing, Role::Reflector];
        let least = least_emission(&cache, &unknowns, &roles);
        assert_eq!((least[0], least[1]), (None, Some(changes[0].value)));
        // An emitter brighter than its lower bounds stays one.
        unknowns = Unknowns::grey([0.6, 0.0], [0.0, 8.0]);
        let settled = classify(&cache, &unknowns, &[Role::Reflector, Role::Emitter], false);
        assert_eq!(settled, []);
    }
}
