//! Radiance and derivatives of cached paths for given unknowns.

use super::derivative::{Gradient, differentiate, radiance};
use super::{CachedCluster, PathCache};
use crate::inverse::parameters::Unknowns;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// One cluster's residual and derivative from both sets.
#[derive(Debug, Clone)]
pub struct Linearised {
    /// Object behind its pixels.
    pub object: u32,
    /// Weight of the squared residual, per channel.
    pub weight: DVec3,
    /// What the squared residual would weigh if all of the photographed radiance were wrong.
    pub floor: DVec3,
    /// Photograph minus model, from set A and from set B.
    pub residuals: [DVec3; 2],
    /// Derivative with respect to the object's own emission if that is all its light, else to its own albedo; mean of
    /// both sets.
    pub own: DVec3,
    /// Place among the free parameters, derivative of A, derivative of B.
    pub rows: Vec<(usize, DVec3, DVec3)>,
}

impl Linearised {
    /// Takes a step along the derivatives, a component a row: the residuals become those after it.
    pub fn step(&mut self, steps: &[DVec3]) {
        let [a, b] = &mut self.residuals;
        for &(row, of_a, of_b) in &self.rows {
            *a -= of_a * steps[row];
            *b -= of_b * steps[row];
        }
    }

    /// What each row adds to the direction of descent, for a weight per channel: ½ w (J_A r_B + J_B r_A).
    pub fn scores(&self, weight: DVec3) -> impl Iterator<Item = DVec3> + '_ {
        let [ra, rb] = self.residuals;
        (self.rows.iter()).map(move |&(_, ja, jb)| weight * (ja * rb + jb * ra) * 0.5)
    }
}

impl PathCache {
    /// Linearises every cluster about some unknowns; `place` maps parameters to rows.
    pub fn linearise(&self, unknowns: &Unknowns, place: &[usize]) -> Vec<Linearised> {
        let parameters = 2 * unknowns.surfaces();
        self.clusters
            .par_iter()
            .map_init(
                || Scratch::new(parameters),
                |scratch, cluster| linearise(cluster, unknowns, place, scratch),
            )
            .collect()
    }

    /// The level of each cluster that its weight goes by, as its paths predict it.
    pub fn levels(&self, unknowns: &Unknowns) -> Vec<Vec3> {
        let clusters = self.clusters.par_iter();
        clusters.map(|cached| level(cached, unknowns)).collect()
    }
}

/// Root of the mean square of what the pixels of a cluster see by these paths, where light that is seen itself differs from
/// path to path and what is reflected by its mean.
///
/// A pixel on the edge of a lamp has a moderate mean, but is as uncertain as its contrast: a sliver of the lamp more or
/// less, by noise or by the camera's position, changes it by many times the dark side's radiance.
fn level(cached: &CachedCluster, unknowns: &Unknowns) -> Vec3 {
    let (mut seen_squared, mut reflected) = (DVec3::ZERO, DVec3::ZERO);
    let mut start = 0;
    for &end in &cached.ends {
        let vertices = &cached.vertices[start..end as usize];
        let seen = vertices.first().map_or(Vec3::ZERO, |vertex| {
            unknowns.emission[vertex.surface as usize] * vertex.emission_weight
        });
        seen_squared += (seen * seen).as_dvec3();
        reflected += (radiance(vertices, unknowns) - seen).as_dvec3();
        start = end as usize;
    }
    let paths = cached.ends.len().max(1) as f64;
    let reflected = reflected / paths;
    (seen_squared / paths + reflected * reflected)
        .powf(0.5)
        .as_vec3()
}

/// Evaluates all paths of a cluster.
fn linearise(
    cached: &CachedCluster,
    unknowns: &Unknowns,
    place: &[usize],
    scratch: &mut Scratch,
) -> Linearised {
    let paths = cached.cluster.paths as usize;
    let scale = 1.0 / (paths * cached.cluster.pixels.len()).max(1) as f32;
    let mut sums = [DVec3::ZERO; 2];
    scratch.gradients.iter_mut().for_each(Gradient::clear);
    let mut start = 0;
    for (path, &end) in cached.ends.iter().enumerate() {
        let set = path / paths % 2;
        let vertices = &cached.vertices[start..end as usize];
        let radiance = differentiate(
            vertices,
            unknowns,
            &mut scratch.gathered,
            &mut scratch.gradients[set],
        );
        sums[set] += radiance.as_dvec3();
        start = end as usize;
    }
    let residuals = sums.map(|sum| cached.cluster.measured.as_dvec3() - sum * f64::from(scale));

    // The parameters that either set touches and that are free.
    let [a, b] = &scratch.gradients;
    let mut rows = Vec::new();
    for &t in a
        .touched
        .iter()
        .chain(b.touched.iter().filter(|&&t| !a.marked[t as usize]))
    {
        let place = place[t as usize];
        if place != usize::MAX {
            let scaled = |g: &Gradient| (g.values[t as usize] * scale).as_dvec3();
            rows.push((place, scaled(a), scaled(b)));
        }
    }
    let object = cached.cluster.object as usize;
    let gives_light_alone =
        unknowns.albedo[object] == Vec3::ZERO && unknowns.emission[object] != Vec3::ZERO;
    let own = object
        + if gives_light_alone {
            unknowns.surfaces()
        } else {
            0
        };
    Linearised {
        own: ((a.values[own] + b.values[own]) * (0.5 * scale)).as_dvec3(),
        object: cached.cluster.object,
        weight: cached.cluster.weight.as_dvec3(),
        floor: (cached.cluster.weight * cached.cluster.measured * cached.cluster.measured)
            .as_dvec3(),
        residuals,
        rows,
    }
}

/// Memory reused from cluster to cluster.
struct Scratch {
    gradients: [Gradient; 2],
    gathered: Vec<Vec3>,
}

impl Scratch {
    fn new(parameters: usize) -> Self {
        Self {
            gradients: [Gradient::new(parameters), Gradient::new(parameters)],
            gathered: Vec::new(),
        }
    }
}
