//! Estimates the model error from the correlation of neighbouring residuals.
//!
//! The noise of photographs and paths is independent between clusters. Errors of the model, such as missing light, are shared by
//! neighbouring clusters, and shift the estimate of a whole object that is smaller than they are, which its own scatter does
//! not show. The mean product of neighbours' residuals is free of noise and estimates the variance of the model error.

use crate::inverse::estimate::{ENOUGH_PIXELS, Estimate};
use crate::inverse::paths::clusters::Cluster;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::roles::Role;
use crate::inverse::unknowns::Unknowns;
use crate::math::stats::quantile;
use crate::transport::bsdf::hemispherical_reflectance;
use glam::{DVec3, Vec3};

/// Residuals are clamped to this fraction of the reflected radiance.
const MAX_RELATIVE: f64 = 0.5;
/// Factor between the errors of whole objects and those that neighbours show. Only this value was tried: with it 78 to 100 % of
/// true albedos lie within two reported errors in each family of `relit trade --rooms 3 --family all --preset preview`; 95 %
/// would be right.
const SHARED: f64 = 2.0;

/// Relative error of albedos where all light comes from outside and none of it was measured there. Between windows only a few
/// directions are measured, and a sun stands a degree or two beside the true one, which shifts the albedo of whole objects and
/// leaves no residuals. Only this value was tried: with it 94 % of true albedos lie within two reported errors in `relit trade
/// --rooms 8 --family window`, and as many in the rooms after them (`--seed 9`).
const OUTSIDE: f64 = 0.04;

/// Standard error of the factor that a scan's albedos share: what was not scanned lights the room too, and lamps saturate, so that
/// photographs of a scan tell ratios of albedos better than albedos. The root mean square of the factor's logarithm is 0.16 in `relit
/// trade --rooms 24 --family scanned --preset preview`. With this value 97 % of the true albedos there lie within two reported errors.
const SCANNED: f32 = 0.2;

/// Least number of pairs of neighbours on an object.
const MIN_PAIRS: u64 = 8;

/// Variance of the model error relative to reflected radiance: the median over objects of the mean product of relative residuals
/// of consecutive clusters in one photograph. It is a median since unmodelled textures look like model errors; objects in
/// `textured` are left out. `clusters` and `linearised` have the same order.
pub fn variance(
    clusters: &[Cluster],
    linearised: &[Linearised],
    unknowns: &Unknowns,
    textured: &[bool],
) -> f64 {
    let surfaces = unknowns.surfaces();
    let mut last: Vec<Option<(u32, f64)>> = vec![None; surfaces];
    let mut sums = vec![(0.0, 0u64); surfaces];
    for (cluster, line) in clusters.iter().zip(linearised) {
        let k = cluster.object as usize;
        let reflected = line.own * unknowns.albedo[k].as_dvec3();
        if line.bound_met().any() || reflected.min_element() <= 0.0 {
            continue;
        }
        let max = DVec3::splat(MAX_RELATIVE);
        let relative = (line.residual() / reflected).clamp(-max, max).element_sum() / 3.0;
        if let Some((frame, before)) = last[k]
            && frame == cluster.frame
        {
            sums[k].0 += relative * before;
            sums[k].1 += 1;
        }
        last[k] = Some((cluster.frame, relative));
    }
    let mut variances: Vec<f64> = (sums.iter().enumerate())
        .filter(|(k, (_, pairs))| *pairs >= MIN_PAIRS && textured.get(*k) != Some(&true))
        .map(|(_, (sum, pairs))| sum / *pairs as f64)
        .collect();
    quantile(&mut variances, 0.5).unwrap_or(0.0).max(0.0)
}

/// Adds the model error to the standard errors of albedos, and of the emission of unseen lamps. `outside` is the fraction of the light
/// that comes from outside and was not measured there.
pub fn add_to(estimate: &mut Estimate, roles: &[Role], variance: f64, outside: f64) {
    let relative = (SHARED * variance.sqrt()).hypot(OUTSIDE * outside) as f32;
    add_to_albedos(estimate, roles, relative);
    for (object, role) in estimate.objects.iter_mut().zip(roles) {
        if *role == Role::Unseen && object.emission_stderr.max_element() < f32::MAX {
            object.emission_stderr = total(object.emission_stderr, object.emission * relative);
        }
    }
}

/// Adds an error relative to albedo to the standard errors of albedos.
fn add_to_albedos(estimate: &mut Estimate, roles: &[Role], relative: f32) {
    for (object, role) in estimate.objects.iter_mut().zip(roles) {
        if role.reflects() {
            object.albedo_stderr = total(object.albedo_stderr, object.albedo * relative);
        }
    }
}

/// The standard error of the sum of two independent errors.
fn total(one: Vec3, other: Vec3) -> Vec3 {
    (one * one + other * other).powf(0.5)
}

/// Adds to the standard errors of albedos the gloss that was not found. Light that a surface mirrors is taken for albedo, or is
/// missing in it, up to the reflectance of its lobe for light from all directions. In a room where a fraction p of the objects has
/// a lobe, of mean squared reflectance s², the others may have one too: a variance of p s².
pub fn add_gloss(estimate: &mut Estimate, roles: &[Role]) {
    let counted = || {
        (estimate.objects.iter().zip(roles))
            .filter(|(object, role)| role.reflects() && object.seen_pixels >= ENOUGH_PIXELS)
            .map(|(object, _)| object)
    };
    let squares = counted()
        .filter_map(|object| object.specular.map(hemispherical_reflectance))
        .map(|s| s * s);
    let variance = squares.sum::<f32>() / counted().count().max(1) as f32;
    for (object, role) in estimate.objects.iter_mut().zip(roles) {
        if role.reflects() && object.specular.is_none() {
            let error = object.albedo_stderr;
            object.albedo_stderr = (error * error + variance).powf(0.5);
        }
    }
}

/// Adds the factor that a scan's albedos share to their standard errors.
pub fn add_common(estimate: &mut Estimate, roles: &[Role]) {
    estimate.common_error = SCANNED;
    add_to_albedos(estimate, roles, SCANNED);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::estimate::ObjectEstimate;
    use crate::math::rng::Stream;
    /// Estimated error of clusters of albedo 0.5 in unit irradiance, with an error that 50 neighbours share and independent noise.
    fn found(shared_error: f64, noise: f64) -> f64 {
        let mut stream = Stream::new(83, 0, 0, 0);
        let mut normal = || {
            (0..12)
                .map(|_| f64::from(stream.uniform()) - 0.5)
                .sum::<f64>()
        };
        let mut shared = 0.0;
        let (clusters, lines) = (0..20_000)
            .map(|i| {
                if i % 50 == 0 {
                    shared = shared_error * normal();
                }
                let residual = DVec3::splat(0.5 * (shared + noise * normal()));
                let line = Linearised {
                    own: DVec3::ONE,
                    ..Linearised::unit(0, residual)
                };
                (Cluster::unit(0, 1, Vec3::splat(0.5)), line)
            })
            .unzip::<_, _, Vec<_>, Vec<_>>();
        let unknowns = Unknowns::grey([0.5], [0.0]);
        variance(&clusters, &lines, &unknowns, &[]).sqrt()
    }

    #[test]
    fn a_mistake_that_neighbours_share_is_told_from_noise() {
        assert!(found(0.0, 0.2) < 0.02, "{}", found(0.0, 0.2));
        // 400 independent errors: the tolerance is 10 % of their deviation, two standard errors.
        for noise in [0.0, 0.1] {
            let sd = found(0.08, noise);
            assert!((sd - 0.08).abs() < 0.008, "{noise}: {sd}");
        }
    }

    fn estimate(objects: Vec<ObjectEstimate>) -> Estimate {
        Estimate {
            objects,
            ..Estimate::default()
        }
    }

    #[test]
    fn gloss_of_some_objects_makes_the_others_less_certain() {
        let object = |specular| ObjectEstimate {
            albedo_stderr: Vec3::splat(0.03),
            seen_pixels: ENOUGH_PIXELS,
            specular,
            ..Default::default()
        };
        let after = |objects: Vec<ObjectEstimate>| -> Vec<f32> {
            let mut estimate = estimate(objects);
            add_gloss(&mut estimate, &[Role::Reflector; 4]);
            let errors = estimate.objects.iter().map(|o| o.albedo_stderr.x);
            errors.collect()
        };
        let matte = || object(None);
        assert_eq!(after(vec![matte(); 4]), [0.03; 4]);
        // One of four has a lobe that reflects 0.08 along the normal and 0.14 of light from all directions; half of that is added.
        let errors = after(vec![object(Some(0.08)), matte(), matte(), matte()]);
        assert_eq!(errors[0], 0.03);
        let expected = 0.03f32.hypot((0.08 + 0.92 * 0.0658) / 2.0);
        assert!((errors[3] - expected).abs() < 1e-4, "{errors:?}");
    }

    #[test]
    fn the_factor_of_a_scan_is_in_each_error_and_not_in_the_reported_one() {
        let object = ObjectEstimate {
            albedo: Vec3::splat(0.5),
            albedo_stderr: Vec3::splat(0.03),
            seen_pixels: ENOUGH_PIXELS,
            ..Default::default()
        };
        let mut estimate = estimate(vec![object; 2]);
        let before = estimate.relative_error();
        add_common(&mut estimate, &[Role::Reflector, Role::Emitter]);
        let expected = 0.03f32.hypot(0.5 * SCANNED);
        assert!((estimate.objects[0].albedo_stderr.x - expected).abs() < 1e-6);
        assert_eq!(estimate.objects[1].albedo_stderr, Vec3::splat(0.03));
        estimate.objects.truncate(1);
        let [before, after] = [before, estimate.relative_error()].map(|e| e.expect("is seen"));
        assert!((before - after).abs() < 1e-6, "{before} {after}");
    }

    #[test]
    fn it_is_added_to_what_reflects_and_to_lamps_out_of_sight() {
        let object = ObjectEstimate {
            albedo: Vec3::splat(0.5),
            albedo_stderr: Vec3::splat(0.01),
            emission: Vec3::splat(10.0),
            emission_stderr: Vec3::splat(0.1),
            ..Default::default()
        };
        let mut estimate = estimate(vec![object; 3]);
        let roles = [Role::Reflector, Role::Unseen, Role::Emitter];
        add_to(&mut estimate, &roles, 0.01, 0.5);
        let model = (SHARED as f32 * 0.1).hypot(OUTSIDE as f32 * 0.5);
        let expected = |error: f32, value: f32| (error * error + (model * value).powi(2)).sqrt();
        let [wall, hidden, lamp] = [0, 1, 2].map(|k| &estimate.objects[k]);
        assert!((wall.albedo_stderr.x - expected(0.01, 0.5)).abs() < 1e-6);
        assert!((hidden.emission_stderr.x - expected(0.1, 10.0)).abs() < 1e-5);
        assert_eq!(lamp.emission_stderr, Vec3::splat(0.1));
        assert_eq!(lamp.albedo_stderr, Vec3::splat(0.01));
    }
}
