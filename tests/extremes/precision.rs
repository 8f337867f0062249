//! The core in f32 against the same in f64, on the same paths.

use crate::{LAMP, ROOM};
use glam::DVec3;
use nalgebra::{Cholesky, DMatrix, DVector};
use relit::calibrate::gbuffer::GBuffer;
use relit::calibrate::held_out::HoldOut;
use relit::inverse::fit::equations::MIN_SIGNAL;
use relit::inverse::fit::errors::standard_errors;
use relit::inverse::fit::gauss_newton::fit;
use relit::inverse::fit::prior::Prior;
use relit::inverse::fit::prior_terms::PriorTerms;
use relit::inverse::fit::robust_weights::RobustWeights;
use relit::inverse::fit::sparse_rows::SparseRows;
use relit::inverse::paths::clusters::{Cluster, cluster, mean_radiance};
use relit::inverse::paths::derivative::{Gradient, differentiate};
use relit::inverse::paths::trace::Tracer;
use relit::inverse::paths::{CachedCluster, NO_LAMP, PathCache, Vertex};
use relit::inverse::settings::{LightSampling, Settings};
use relit::inverse::unknowns::Unknowns;
use relit::transport::emitters::Emitters;

const SURFACES: usize = 8;

/// Paths to the lamp, and the parameters that are fitted: every albedo but the lamp's, and its emission.
fn cache() -> (PathCache, Vec<Cluster>, Vec<usize>) {
    let problem = &ROOM.0;
    let gbuffer = GBuffer::new(
        problem,
        HoldOut::from(&Settings::default()),
        Settings::default().seed,
        100_000,
    );
    let mut clusters = cluster(problem, &gbuffer, 100_000);
    clusters.iter_mut().for_each(|c| c.paths = 4);
    let mut weights = vec![0.02; SURFACES];
    weights[LAMP] = 1.0;
    let lights = Emitters::new(&problem.scene, &weights);
    let tracer = Tracer {
        scene: &problem.scene,
        lights: &lights,
        measured: None,
        texels: None,
        sky: None,
        outside: None,
        surface_of: &problem.scene.object_of,
        expected_albedo: &[0.6; SURFACES],
        lobes: &[],
        patches: None,
        sampling: LightSampling::Mis,
        max_bounces: 1000,
        seed: 131,
        stage: 0,
        round: 0,
    };
    let cache = tracer.trace(&clusters);
    assert_eq!(cache.cast.rejected, 0);
    let free = (0..SURFACES)
        .filter(|&k| k != LAMP)
        .chain([SURFACES + LAMP]);
    (cache, clusters, free.collect())
}

/// One channel of all unknowns, albedos first.
type Channel = [f64; 2 * SURFACES];

/// Radiance of a path in f64 in one channel, its derivative added to `gradient`: the product rule, term by term.
fn exact(vertices: &[Vertex], x: &Channel, channel: usize, gradient: &mut Channel) -> f64 {
    // What arrives at each vertex, and what leaves it.
    let mut gathered = vec![0.0; vertices.len()];
    let mut beyond = 0.0;
    for (v, g) in vertices.iter().zip(&mut gathered).rev() {
        *g = beyond + f64::from(v.known[channel]);
        if v.lamp != NO_LAMP {
            *g += x[SURFACES + v.lamp as usize] * f64::from(v.lamp_weight);
        }
        beyond = x[SURFACES + v.surface as usize] * f64::from(v.emission_weight)
            + x[v.surface as usize] * *g;
    }
    let mut throughput = 1.0;
    for (v, g) in vertices.iter().zip(&gathered) {
        gradient[SURFACES + v.surface as usize] += throughput * f64::from(v.emission_weight);
        gradient[v.surface as usize] += throughput * g;
        throughput *= x[v.surface as usize];
        if v.lamp != NO_LAMP {
            gradient[SURFACES + v.lamp as usize] += throughput * f64::from(v.lamp_weight);
        }
    }
    beyond
}

/// Means over a cluster of both sets: radiance and derivative.
fn means(cached: &CachedCluster, x: &Channel, channel: usize) -> [(f64, Channel); 2] {
    let mut sums = [(0.0, [0.0; 2 * SURFACES]); 2];
    let paths = cached.cluster.paths as usize;
    let mut start = 0;
    for (path, &end) in cached.ends.iter().enumerate() {
        let (radiance, gradient) = &mut sums[path / paths % 2];
        *radiance += exact(&cached.vertices[start..end as usize], x, channel, gradient);
        start = end as usize;
    }
    let n = (paths * cached.cluster.pixels.len()) as f64;
    for (radiance, gradient) in &mut sums {
        *radiance /= n;
        gradient.iter_mut().for_each(|g| *g /= n);
    }
    sums
}

/// The zero of the same unbiased descent direction, all in f64, by Gauss–Newton steps to the last digit.
fn fit_in_f64(
    cache: &PathCache,
    free: &[usize],
    prior: &Prior,
    start: &Unknowns,
    channel: usize,
) -> Channel {
    let mut x = [0.0; 2 * SURFACES];
    for k in 0..SURFACES {
        x[k] = f64::from(start.albedo[k][channel]);
        x[SURFACES + k] = f64::from(start.emission[k][channel]);
    }
    for _ in 0..200 {
        let n = free.len();
        let mut hessian = DMatrix::<f64>::zeros(n, n);
        let mut descent = DVector::<f64>::zeros(n);
        let mut objective = 0.0;
        let [mut path_scatter, mut across] = [vec![0.0; n], vec![0.0; n]];
        for cached in &cache.clusters {
            let [(la, ja), (lb, jb)] = means(cached, &x, channel);
            let measured = f64::from(cached.cluster.measured[channel]);
            let weight_at = |fitted| cached.cluster.weight(DVec3::splat(fitted))[channel];
            let weight = weight_at((la + lb) * 0.5);
            let [wa, wb] = [la, lb].map(weight_at);
            let (ra, rb) = (measured - la, measured - lb);
            objective += weight * ra * rb;
            for (i, &p) in free.iter().enumerate() {
                let [score_a, score_b] = [wa * ja[p] * rb, wb * jb[p] * ra];
                descent[i] += 0.5 * (score_a + score_b);
                path_scatter[i] += (0.5 * (score_a - score_b)).powi(2);
                across[i] += weight * ja[p] * jb[p];
                for (j, &q) in free.iter().enumerate() {
                    hessian[(i, j)] += 0.25 * weight * (ja[p] + jb[p]) * (ja[q] + jb[q]);
                }
            }
        }
        let mean_noise = (objective / cache.clusters.len() as f64).max(1e-12);
        for (i, &p) in free.iter().enumerate() {
            let curvature = across[i].max(MIN_SIGNAL * hessian[(i, i)]);
            let noise = match hessian[(i, i)] > 0.0 {
                true => mean_noise + path_scatter[i] / curvature,
                false => mean_noise,
            };
            // The program's prior knows surfaces outside too; here there are none.
            let (mean, precision) = prior.of(p, DVec3::splat(noise));
            let (mean, precision) = (mean[channel], precision[channel]);
            descent[i] += precision * (mean - x[p]);
            hessian[(i, i)] += precision;
        }
        let step = Cholesky::new(hessian).expect("definite").solve(&descent);
        for (i, &p) in free.iter().enumerate() {
            x[p] += step[i];
        }
        if step.amax() < 1e-13 {
            break;
        }
    }
    x
}

/// The estimate of the f64 twin lies within a hundredth of the reported standard error.
#[test]
fn the_fit_agrees_with_its_twin_in_f64() {
    let (cache, clusters, free) = cache();
    let prior = Prior::new(SURFACES, SURFACES, mean_radiance(&clusters));
    let robust = RobustWeights::even(SURFACES);
    // Taken up again from its own end, so that where a fit is content to stop does not count.
    let again = |start: &Unknowns| {
        fit(&cache, start, &free, &robust, &prior, 60, |_| {
            Ok::<(), ()>(())
        })
        .expect("goes on")
    };
    let mut found = again(&Unknowns::new(SURFACES));
    for _ in 0..8 {
        found = again(&found.unknowns);
    }
    let scores = SparseRows::scores(&found.clusters, free.len(), &robust, |_| DVec3::ONE);
    let terms = PriorTerms::new(&found.equations, &free, &found.unknowns);
    let errors = standard_errors(&found.equations, &terms, &scores, &free, SURFACES);
    let mut worst = 0.0f64;
    for channel in 0..3 {
        let twin = fit_in_f64(&cache, &free, &prior, &found.unknowns, channel);
        for &p in &free {
            let ours = f64::from(found.unknowns.value(p)[channel]);
            let error = match p.checked_sub(SURFACES) {
                None => errors.albedo[p][channel],
                Some(k) => errors.emission[k][channel],
            };
            let off = (ours - twin[p]).abs() / f64::from(error);
            worst = worst.max(off);
            println!(
                "parameter {p} channel {channel}: {ours:.7} against {:.7}, {off:.4} of ± {error:.5}",
                twin[p]
            );
            assert!(
                error > 0.0 && off < 0.01,
                "parameter {p}, channel {channel}"
            );
        }
    }
    println!("worst {worst:.4} standard errors");
}

/// Where digits are lost: largest relative differences of f32 to f64, step by step on the way from paths to equations.
#[test]
fn precision_is_lost_nowhere_but_in_the_last_digits() {
    let (cache, ..) = cache();
    let mut unknowns = Unknowns::new(SURFACES);
    unknowns.emission[LAMP] = glam::Vec3::new(14.0, 12.0, 9.0);
    let mut x = [0.0; 2 * SURFACES];
    x[..SURFACES].fill(0.5);
    x[SURFACES + LAMP] = 14.0;
    let (mut path, mut slope) = (0.0f64, 0.0f64);
    let (mut gathered, mut gradient) = (Vec::new(), Gradient::new(2 * SURFACES));
    let (mut longest, mut mean) = (0, 0.0f64);
    for cached in &cache.clusters {
        let mut start = 0;
        for &end in &cached.ends {
            let vertices = &cached.vertices[start..end as usize];
            start = end as usize;
            longest = longest.max(vertices.len());
            gradient.clear();
            let found = differentiate(vertices, &unknowns, &[], &mut gathered, &mut gradient).x;
            let mut wanted = [0.0; 2 * SURFACES];
            let radiance = exact(vertices, &x, 0, &mut wanted);
            path = path.max((f64::from(found) - radiance).abs() / radiance.max(1e-30));
            for (found, wanted) in gradient.values.iter().zip(wanted) {
                slope = slope.max((f64::from(found.x) - wanted).abs() / wanted.max(1e-30));
            }
        }
        let [a, b] = means(cached, &x, 0);
        let place = vec![usize::MAX; 2 * SURFACES];
        let one = PathCache {
            clusters: vec![cached.clone()],
            ..PathCache::default()
        };
        let residuals = one.linearise(&unknowns, &place, &[])[0].residuals;
        let wanted = DVec3::new(a.0, b.0, 0.0);
        for (found, wanted) in residuals.iter().zip([wanted.x, wanted.y]) {
            let found = f64::from(cached.cluster.measured.x) - found.x;
            mean = mean.max((found - wanted).abs() / wanted.max(1e-30));
        }
    }
    println!("longest path {longest} vertices");
    println!(
        "radiance of a path: {path:.1e}; its derivative: {slope:.1e}; mean of a cluster: {mean:.1e}"
    );
    assert!(longest > 10, "{longest}");
    assert!(
        path < 3e-6 && slope < 3e-6 && mean < 1e-6,
        "{path:e} {slope:e} {mean:e}"
    );
}
