//! Radiance and derivatives of cached paths for given unknowns, and the normal equations of the fit.
//!
//! With one set of paths for both, noise in the derivative correlates with noise in the residual and an ℓ2 fit is
//! biased towards darkness. Products are therefore taken across the two independent sets A and B.

use super::derivative::{Gradient, differentiate};
use super::prior::Prior;
use super::roles::places;
use super::trust::Trust;
use super::{CachedCluster, PathCache};
use crate::inverse::parameters::Unknowns;
use glam::{DVec3, Vec3};
use nalgebra::{DMatrix, DVector};
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

/// Sums over the clusters of the fit for one set of unknowns.
#[derive(Debug, Clone)]
pub struct NormalEquations {
    /// Per channel: Σ w J̄ J̄ᵀ over the free parameters with J̄ = (J_A + J_B)/2; never indefinite. Lower triangle.
    pub hessian: [DMatrix<f64>; 3],
    /// Per channel: ½ Σ w (J_A r_B + J_B r_A), the unbiased direction of descent.
    pub descent: [DVector<f64>; 3],
    /// Per channel: Σ w J_A J_B, what is known of each parameter apart from noise.
    pub information: [DVector<f64>; 3],
    /// Per channel: Σ g gᵀ of the clusters' contributions g to `descent`, for standard errors. Lower triangle.
    pub scatter: [DMatrix<f64>; 3],
    /// Per channel: Σ w r_A r_B, an unbiased measure of the squared error.
    pub objective: DVec3,
    /// Clusters in the sums.
    pub clusters: usize,
    /// What is believed besides.
    pub prior: Prior,
}

impl PathCache {
    /// The normal equations for the parameters in `free` (indices into albedos, then emissions).
    pub fn normal_equations(
        &self,
        unknowns: &Unknowns,
        free: &[usize],
        trust: &Trust,
        prior: &Prior,
    ) -> NormalEquations {
        let places = places(free, unknowns.surfaces());
        NormalEquations::new(&self.linearise(unknowns, &places), free.len(), trust, prior)
    }
}

impl NormalEquations {
    /// Sums over linearised clusters with `n` rows.
    pub fn new(linearised: &[Linearised], n: usize, trust: &Trust, prior: &Prior) -> Self {
        let mut sums = Self {
            hessian: std::array::from_fn(|_| DMatrix::zeros(n, n)),
            descent: std::array::from_fn(|_| DVector::zeros(n)),
            information: std::array::from_fn(|_| DVector::zeros(n)),
            scatter: std::array::from_fn(|_| DMatrix::zeros(n, n)),
            objective: DVec3::ZERO,
            clusters: linearised.len(),
            prior: prior.clone(),
        };
        for cluster in linearised {
            sums.add(cluster, trust.of(cluster.object));
        }
        sums
    }
}

impl PathCache {
    /// Photograph minus model for each cluster, from set A and from set B.
    pub fn residuals(&self, unknowns: &Unknowns) -> Vec<[DVec3; 2]> {
        let place = vec![usize::MAX; 2 * unknowns.surfaces()];
        self.linearise(unknowns, &place)
            .into_iter()
            .map(|l| l.residuals)
            .collect()
    }

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

impl NormalEquations {
    fn add(&mut self, cluster: &Linearised, trust: DVec3) {
        let Linearised {
            weight,
            residuals,
            rows,
            ..
        } = cluster;
        let weight = *weight * trust;
        self.objective += weight * residuals[0] * residuals[1];
        let scores: Vec<DVec3> = rows
            .iter()
            .map(|&(_, ja, jb)| weight * (ja * residuals[1] + jb * residuals[0]) * 0.5)
            .collect();
        for (&(i, ja, jb), score) in rows.iter().zip(&scores) {
            let information = weight * ja * jb;
            for c in 0..3 {
                self.descent[c][i] += score[c];
                self.information[c][i] += information[c];
            }
        }
        for (&(i, ia, ib), &si) in rows.iter().zip(&scores) {
            let row = weight * (ia + ib) * 0.25;
            for (&(j, ja, jb), &sj) in rows.iter().zip(&scores) {
                if j > i {
                    continue;
                }
                let h = row * (ja + jb);
                let s = si * sj;
                for c in 0..3 {
                    self.hessian[c][(i, j)] += h[c];
                    self.scatter[c][(i, j)] += s[c];
                }
            }
        }
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
