//! Selects the objects that are worth a trial of a lobe: their photographs differ between views as a lobe predicts.

use crate::inverse::lobe::gather::{Components, Gathered, Gathering};
use crate::inverse::lobe::observations::{Spot, SpotObservation, choose};
use crate::math::stats::quantile;
use crate::scene::Scene;
use crate::transport::arrival::RayCount;
use glam::DVec3;
use rayon::prelude::*;

const MAX_OBSERVATIONS: usize = 600;
const MIN_OBSERVATIONS: usize = 12;
const ROUGHNESSES: [f64; 3] = [0.1, 0.25, 0.6];
const SPECULAR: f64 = 0.1;
/// Expected differences are clamped to this multiple of their 68th percentile.
const CLIP: f64 = 5.0;

/// GGX roughnesses that directions are sampled from.
pub const DRAWN: [f64; 2] = [0.15, 0.5];

/// An observation's differences from the mean of its spot, relative to the spot's measured radiance.
struct Difference {
    weight: f64,
    /// Change of radiance by a lobe.
    expected: DVec3,
    /// Radiance of a diffuse surface of unit albedo.
    diffuse: DVec3,
    measured: DVec3,
}

/// The fitted strength of a lobe in standard errors, at the most significant roughness, from differences between photographs of
/// the same spots; `None` if too few spots are seen by several photographs.
///
/// Few paths suffice: their noise is independent of the photographs', so it can hide a lobe but not feign one.
pub fn evidence(
    gathering: &Gathering,
    scene: &Scene,
    spots: &[Spot],
    albedo: DVec3,
) -> (Option<f64>, RayCount) {
    let chosen = choose(spots, 2, MAX_OBSERVATIONS);
    let observations: usize = chosen.iter().map(|s| s.len()).sum();
    if observations < MIN_OBSERVATIONS {
        return (None, RayCount::default());
    }
    type Own<'a> = Vec<(&'a SpotObservation, Gathered)>;
    let (gathered, casts): (Vec<Own>, Vec<RayCount>) = (chosen.par_iter())
        .map(|spot| {
            let mut cast = RayCount::default();
            let own = (spot.iter().filter(|s| !s.held_out))
                .map(|observation| {
                    let camera = &scene.cameras[observation.frame as usize];
                    let (sets, more) = gathering.observation(camera, observation);
                    cast += more;
                    (observation, Gathered::joined(sets))
                })
                .filter(|(_, light)| !light.is_empty())
                .collect();
            (own, cast)
        })
        .unzip();
    let strongest = (ROUGHNESSES.iter())
        .filter_map(|&alpha| {
            let all: Vec<Vec<Difference>> = (gathered.par_iter())
                .map(|own| differences(own, alpha, albedo))
                .collect();
            let all: Vec<Difference> = all.into_iter().flatten().collect();
            strength(&all, gathered.len())
        })
        .reduce(f64::max);
    (strongest, casts.into_iter().sum())
}

/// The differences of a spot's observations; none for fewer than two.
fn differences(own: &[(&SpotObservation, Gathered)], alpha: f64, albedo: DVec3) -> Vec<Difference> {
    let mut all: Vec<Difference> = (own.iter())
        .map(|(observation, light)| {
            let components = light.components(alpha);
            Difference {
                weight: observation.pixels.len() as f64,
                expected: with_lobe(&components, albedo) - albedo * components.diffuse,
                diffuse: components.diffuse,
                measured: observation.measured,
            }
        })
        .collect();
    let weight: f64 = all.iter().map(|d| d.weight).sum();
    let mean = |value: &dyn Fn(&Difference) -> DVec3| {
        all.iter().map(|d| value(d) * d.weight).sum::<DVec3>() / weight
    };
    let (expected, diffuse, measured) = (
        mean(&|d| d.expected),
        mean(&|d| d.diffuse),
        mean(&|d| d.measured),
    );
    if measured.min_element() <= 0.0 || all.len() < 2 {
        return Vec::new();
    }
    for d in &mut all {
        d.expected = (d.expected - expected) / measured;
        d.diffuse = (d.diffuse - diffuse) / measured;
        d.measured = (d.measured - measured) / measured;
    }
    all
}

/// Radiance of a surface with the tested specular reflectance.
fn with_lobe(components: &Components, albedo: DVec3) -> DVec3 {
    (albedo * components.base + components.grazing) * (1.0 - SPECULAR) + components.lobe * SPECULAR
}

/// The regression coefficient of the measured differences on the expected ones, in standard errors, with the differences of
/// irradiance within the spots as a second regressor.
fn strength(all: &[Difference], spots: usize) -> Option<f64> {
    let mut sizes: Vec<f64> = (all.iter())
        .map(|d| d.expected.abs().max_element())
        .collect();
    let max = DVec3::splat(CLIP * quantile(&mut sizes, 0.68)?);
    // Normal equations of two regressors.
    let (mut xx, mut xd, mut dd, mut xy, mut dy, mut yy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for difference in all {
        let (x, d, y) = (
            difference.expected.clamp(-max, max),
            difference.diffuse,
            difference.measured,
        );
        let w = difference.weight;
        xx += w * x.dot(x);
        xd += w * x.dot(d);
        dd += w * d.dot(d);
        xy += w * x.dot(y);
        dy += w * d.dot(y);
        yy += w * y.dot(y);
    }
    let (own, score, explained) = if dd > 0.0 {
        (xx - xd * xd / dd, xy - xd * dy / dd, dy * dy / dd)
    } else {
        (xx, xy, 0.0)
    };
    // The channels of an observation are strongly correlated, so they count once.
    let freedom = all.len().checked_sub(spots + 2).filter(|&n| n > 0)? as f64;
    let slope = score / own;
    let noise = (yy - explained - slope * score).max(0.0) / freedom;
    let t = slope / (noise / own).sqrt();
    t.is_finite().then_some(t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;

    /// Differences with a lobe of the given strength, and noise of 5 %.
    fn made(strength: f64, seed: u64) -> Vec<Difference> {
        let mut stream = Stream::new(seed, 0, 0, 0);
        (0..300)
            .map(|_| {
                let mut centered = || {
                    let sum: f32 = (0..4).map(|_| stream.uniform()).sum();
                    f64::from(sum - 2.0) * 3f64.sqrt()
                };
                let expected = DVec3::splat(0.02 * centered());
                Difference {
                    weight: 1.0,
                    expected,
                    diffuse: DVec3::splat(0.01 * centered()),
                    measured: expected * strength + DVec3::splat(0.05 * centered()),
                }
            })
            .collect()
    }

    /// Of 40 standard scores, one exceeds 4 with a probability of 1/400.
    #[test]
    fn a_lobe_is_told_from_noise() {
        for seed in 0..40 {
            let nothing = strength(&made(0.0, seed), 100).expect("enough observations");
            assert!(nothing.abs() < 4.0, "{nothing}");
        }
        let lobe = strength(&made(1.5, 50), 100).expect("enough observations");
        assert!(lobe > 5.0, "{lobe}");
    }
}
