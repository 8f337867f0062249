//! Evaluates the cached paths of all clusters for given unknowns: residuals, derivatives, and levels.

use crate::inverse::paths::derivative::{Gradient, differentiate, radiance, textured_radiance};
use crate::inverse::paths::{CachedCluster, PathCache, SPECULAR, Vertex};
use crate::inverse::unknowns::Unknowns;
use glam::{BVec3, DVec3, Vec3, Vec3A};
use rayon::prelude::*;

/// A cluster's residuals and derivatives from two independent sets of paths.
#[derive(Debug, Clone)]
pub struct Linearised {
    /// Object that its pixels see.
    pub object: u32,
    /// Weight of the squared residual, per channel.
    pub weight: DVec3,
    /// Weights at the radiance of set A and of set B alone, over `weight`.
    pub of_sets: [DVec3; 2],
    /// Number of pixels, which is the weight of a squared relative residual.
    pub pixels: f64,
    /// Photograph minus model, from set A and from set B.
    pub residuals: [DVec3; 2],
    /// Channels in which the photograph is saturated: a brighter model has no residual there.
    pub censored: BVec3,
    /// Derivative with respect to the emission of a pure emitter, or else the object's albedo; mean of both sets.
    pub own: DVec3,
    /// Index of a free parameter, derivative from set A, derivative from set B; by increasing index.
    pub rows: Vec<(usize, DVec3, DVec3)>,
}

impl Linearised {
    /// Subtracts the linear effect of a step of the free parameters from the residuals.
    pub fn step(&mut self, steps: &[DVec3]) {
        let [a, b] = &mut self.residuals;
        for &(row, of_a, of_b) in &self.rows {
            *a -= of_a * steps[row];
            *b -= of_b * steps[row];
        }
    }

    /// Photograph minus model, the mean of both sets.
    pub fn residual(&self) -> DVec3 {
        (self.residuals[0] + self.residuals[1]) * 0.5
    }

    /// Channels in which the photograph is saturated and the model at least as bright, so that the lower bound holds.
    pub fn bound_met(&self) -> BVec3 {
        self.censored & self.residual().cmple(DVec3::ZERO)
    }

    /// The weight of the squared residual, zero where [`Self::bound_met`].
    pub fn weight_now(&self) -> DVec3 {
        DVec3::select(self.bound_met(), DVec3::ZERO, self.weight)
    }

    /// Each row's term of the unbiased right-hand side, for a weight per channel: ½ w (J_A r_B + J_B r_A). Each residual is weighed
    /// at the radiance of the other set, whose noise is not its own.
    pub fn scores(&self, weight: DVec3) -> impl Iterator<Item = DVec3> + '_ {
        self.set_scores(weight).map(|[a, b]| (a + b) * 0.5)
    }

    /// The terms of both sets, whose mean is [`Self::scores`]: w J_A r_B and w J_B r_A. They differ by path noise alone.
    pub fn set_scores(&self, weight: DVec3) -> impl Iterator<Item = [DVec3; 2]> + '_ {
        let [ra, rb] = self.residuals;
        let [wa, wb] = self.of_sets;
        (self.rows.iter()).map(move |&(_, ja, jb)| [ja * rb * wa, jb * ra * wb].map(|s| weight * s))
    }
}

impl PathCache {
    /// Linearises every cluster about `unknowns`. `row_of` maps parameters to rows, `usize::MAX` for fixed ones. `reflected` is
    /// the radiance that each patch of a lamp would reflect with an albedo of one; empty if the paths have no patches.
    pub fn linearise(
        &self,
        unknowns: &Unknowns,
        row_of: &[usize],
        reflected: &[Vec3],
    ) -> Vec<Linearised> {
        let parameters = 2 * unknowns.surfaces();
        self.clusters
            .par_iter()
            .map_init(
                || {
                    let gradients = [(); 2].map(|()| Gradient::new(parameters));
                    (gradients, Vec::new(), Vec::new())
                },
                |scratch, cluster| linearise(cluster, unknowns, row_of, reflected, scratch),
            )
            .collect()
    }

    /// Every cluster's residuals at `unknowns`, without derivatives.
    pub fn residuals(&self, unknowns: &Unknowns) -> Vec<Linearised> {
        self.linearise(unknowns, &vec![usize::MAX; 2 * unknowns.surfaces()], &[])
    }

    /// Change of each cluster's mean radiance by textures with the albedos `texels`, summed path by path.
    pub fn texture_offsets(&self, unknowns: &Unknowns, texels: &[Vec3]) -> Vec<DVec3> {
        let clusters = self.clusters.par_iter();
        let offset = |cached: &CachedCluster| {
            let [a, b] = means(cached, |vertices, _| {
                textured_radiance(vertices, unknowns, texels) - radiance(vertices, unknowns)
            });
            (a + b) * 0.5
        };
        clusters.map(offset).collect()
    }

    /// Each cluster's level for [`Cluster::weight`](crate::inverse::paths::clusters::Cluster::weight), predicted by its paths.
    pub fn levels(&self, unknowns: &Unknowns) -> Vec<Vec3> {
        let clusters = self.clusters.par_iter();
        clusters.map(|cached| level(cached, unknowns)).collect()
    }
}

/// Square root of the mean square of directly seen emission plus the squared mean of all other radiance.
///
/// A pixel on the edge of a lamp has a moderate mean but is as uncertain as its contrast: a small error of the camera's position
/// changes it by many times the dark side's radiance. The mean square accounts for that.
fn level(cached: &CachedCluster, unknowns: &Unknowns) -> Vec3 {
    let (mut emitted_squared, mut reflected) = (DVec3::ZERO, DVec3::ZERO);
    for vertices in cached.paths() {
        let first = vertices.first().filter(|v| v.surface != SPECULAR);
        let emitted = first.map_or(Vec3::ZERO, |vertex| {
            unknowns.emission[vertex.surface as usize] * vertex.emission_weight
        });
        emitted_squared += (emitted * emitted).as_dvec3();
        reflected += (radiance(vertices, unknowns) - emitted).as_dvec3();
    }
    let paths = cached.ends.len().max(1) as f64;
    let reflected = reflected / paths;
    (emitted_squared / paths + reflected * reflected)
        .powf(0.5)
        .as_vec3()
}

/// Mean of `f(path, set)` over the paths of each set.
fn means(cached: &CachedCluster, mut f: impl FnMut(&[Vertex], usize) -> Vec3) -> [DVec3; 2] {
    let paths = cached.cluster.paths as usize;
    let mut sums = [DVec3::ZERO; 2];
    for (path, vertices) in cached.paths().enumerate() {
        let set = path / paths % 2;
        sums[set] += f(vertices, set).as_dvec3();
    }
    sums.map(|sum| sum * f64::from(scale(cached)))
}

/// One over the number of paths in each set.
fn scale(cached: &CachedCluster) -> f32 {
    let paths = cached.cluster.paths as usize * cached.cluster.pixels.len();
    1.0 / paths.max(1) as f32
}

fn linearise(
    cached: &CachedCluster,
    unknowns: &Unknowns,
    row_of: &[usize],
    reflected: &[Vec3],
    (gradients, incident, rows): &mut Scratch,
) -> Linearised {
    gradients.iter_mut().for_each(Gradient::clear);
    let means = means(cached, |vertices, set| {
        differentiate(vertices, unknowns, reflected, incident, &mut gradients[set])
    });
    let residuals = means.map(|mean| cached.cluster.measured.as_dvec3() - mean);
    let weight = cached.cluster.weight((means[0] + means[1]) * 0.5);

    // The free parameters that either set touches.
    let [a, b] = &*gradients;
    let scale = scale(cached);
    rows.clear();
    for &t in a
        .touched
        .iter()
        .chain(b.touched.iter().filter(|&&t| !a.marked[t as usize]))
    {
        let row = row_of[t as usize];
        if row != usize::MAX {
            let scaled = |g: &Gradient| Vec3::from(g.values[t as usize] * scale).as_dvec3();
            rows.push((row, scaled(a), scaled(b)));
        }
    }
    rows.sort_unstable_by_key(|row| row.0);
    let object = cached.cluster.object as usize;
    let is_pure_emitter =
        unknowns.albedo[object] == Vec3::ZERO && unknowns.emission[object] != Vec3::ZERO;
    let own = match is_pure_emitter {
        true => object + unknowns.surfaces(),
        false => object,
    };
    Linearised {
        own: Vec3::from((a.values[own] + b.values[own]) * (0.5 * scale)).as_dvec3(),
        object: cached.cluster.object,
        weight,
        of_sets: means.map(|mean| cached.cluster.weight(mean) / weight),
        pixels: cached.cluster.pixels.len() as f64,
        residuals,
        censored: cached.cluster.censored,
        rows: rows.to_vec(),
    }
}

/// Memory reused between clusters: a gradient of each set, what arrives along a path, and rows.
type Scratch = ([Gradient; 2], Vec<Vec3A>, Vec<(usize, DVec3, DVec3)>);

#[cfg(test)]
impl Linearised {
    /// A cluster for tests: one pixel, unit weight, equal residuals of both sets, no derivatives.
    pub fn unit(object: u32, residual: DVec3) -> Self {
        Self {
            object,
            weight: DVec3::ONE,
            of_sets: [DVec3::ONE; 2],
            pixels: 1.0,
            residuals: [residual; 2],
            censored: BVec3::FALSE,
            own: DVec3::ZERO,
            rows: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::paths::clusters::Cluster;
    use crate::inverse::paths::{NO_LAMP, NO_TEXEL};

    /// One path over a textured surface (0) and a plain one (1) that reaches a lamp (2), and one path over the plain one alone.
    fn cached() -> CachedCluster {
        let vertex = |surface: u32, texel: u32, lamp: u32| Vertex {
            lamp,
            lamp_weight: 0.5,
            texel,
            ..Vertex::on(surface)
        };
        CachedCluster {
            cluster: Cluster::unit(0, 1, Vec3::ONE),
            vertices: vec![
                vertex(0, 1, NO_LAMP),
                vertex(1, NO_TEXEL, 2),
                vertex(1, NO_TEXEL, 2),
            ],
            ends: vec![2, 3],
        }
    }

    fn unknowns() -> Unknowns {
        Unknowns::grey([0.4, 0.8, 0.0], [0.0, 0.0, 10.0])
    }

    #[test]
    fn a_texture_changes_the_paths_that_meet_it_by_the_difference_of_its_texel() {
        let cache = PathCache::from(vec![cached()]);
        let texels = [Vec3::splat(0.1), Vec3::new(0.6, 0.4, 0.2)];
        let [offset] = cache.texture_offsets(&unknowns(), &texels)[..] else {
            panic!("there is one cluster");
        };
        // (texel - 0.4) * 0.8 * 10 * 0.5 in one of two paths.
        let expected = (texels[1].as_dvec3() - DVec3::splat(0.4)) * 0.8 * 10.0 * 0.5 * 0.5;
        assert!((offset - expected).length() < 1e-6, "{offset}");
    }

    /// Green is saturated: a darker model has a residual there, a brighter one has none.
    #[test]
    fn a_lower_bound_has_no_residual_where_the_model_exceeds_it() {
        let mut bound = cached();
        bound.cluster.censored = BVec3::new(false, true, false);
        let mut linearise = |measured: f32| {
            bound.cluster.measured = Vec3::splat(measured);
            let cache = PathCache::from(vec![bound.clone()]);
            cache.residuals(&unknowns()).remove(0)
        };
        let (darker, brighter) = (linearise(9.0), linearise(0.1));
        assert!(darker.residual().min_element() > 0.0);
        assert!(brighter.residual().max_element() < 0.0);
        assert_eq!(darker.weight_now(), DVec3::ONE);
        assert_eq!(brighter.weight_now(), DVec3::new(1.0, 0.0, 1.0));
    }

    /// Set A sees the light 1, set B the light 3, both by an albedo of a half.
    #[test]
    fn each_residual_is_weighed_at_the_radiance_of_the_other_set() {
        let path = |light: f32| Vertex {
            known: Vec3::splat(light),
            ..Vertex::on(0)
        };
        let cache = PathCache::from(vec![CachedCluster {
            cluster: Cluster {
                level: None,
                ..Cluster::unit(0, 1, Vec3::ONE)
            },
            vertices: vec![path(1.0), path(3.0)],
            ends: vec![1, 2],
        }]);
        let unknowns = Unknowns::grey([0.5], [0.0]);
        let line = cache.linearise(&unknowns, &[0, usize::MAX], &[]).remove(0);
        let score = line.scores(line.weight).next().expect("one row").x;
        let weight = |radiance: f64| 1.0 / ((1.0 + radiance * radiance) * 0.5 + 1.0);
        let expected = (weight(0.5) * 1.0 * (1.0 - 1.5) + weight(1.5) * 3.0 * (1.0 - 0.5)) * 0.5;
        assert!((score - expected).abs() < 1e-6, "{score} for {expected}");
    }

    #[test]
    fn the_edge_of_a_lamp_is_as_uncertain_as_its_contrast() {
        let mut edge = cached();
        // One of two paths sees the lamp itself.
        edge.vertices[2].surface = 2;
        edge.vertices[2].lamp = NO_LAMP;
        edge.vertices[2].emission_weight = 1.0;
        let reflected = 0.4 * 0.8 * 10.0 * 0.5 / 2.0;
        let expected = f32::sqrt(10.0 * 10.0 / 2.0 + reflected * reflected);
        assert!((level(&edge, &unknowns()).x - expected).abs() < 1e-4);
    }
}
