//! Which objects are worth a trial: those that look different from different sides, and as a lobe would make them.

use crate::inverse::lobe::gather::{Gathered, Gathering, Parts};
use crate::inverse::lobe::observations::{Spot, SpotObservation, choose};
use crate::math::stats::quantile;
use crate::scene::Scene;
use crate::transport::arrival::Cast;
use glam::DVec3;
use rayon::prelude::*;

/// Observations that are looked at.
const MAX_SIGHTS: usize = 600;
/// Observations that an object needs.
const MIN_SIGHTS: usize = 12;
/// GGX roughnesses that are looked for, and the specular reflectance.
const ROUGHNESSES: [f64; 3] = [0.1, 0.25, 0.6];
const SPECULAR: f64 = 0.1;
/// One observation's expected difference counts up to so many times what two of three stay below.
const CLIP: f64 = 5.0;

/// Directions at a point in screening are drawn by these roughnesses.
pub const DRAWN: [f64; 2] = [0.15, 0.5];

/// What a lobe would change in a observation, what a diffuse surface shows of its light, and what the photograph shows.
struct Difference {
    weight: f64,
    expected: DVec3,
    diffuse: DVec3,
    shown: DVec3,
}

/// How many standard errors the strength of a lobe is above zero, at the roughness that speaks for it most, judged by
/// differences between photographs of the same spots; `None` where too few spots are seen by several photographs.
///
/// Light is gathered roughly: its noise hides a lobe but makes none, being independent of the photographs'.
pub fn evidence(
    gathering: &Gathering,
    scene: &Scene,
    spots: &[Spot],
    albedo: DVec3,
) -> (Option<f64>, Cast) {
    let chosen = choose(spots, 2, MAX_SIGHTS);
    let observations: usize = chosen.iter().map(|s| s.len()).sum();
    if observations < MIN_SIGHTS {
        return (None, Cast::default());
    }
    let gathered: Vec<(Vec<(&SpotObservation, Gathered)>, Cast)> = (chosen.par_iter())
        .map(|spot| {
            let mut cast = Cast::default();
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
        .collect();
    let cast = gathered.iter().map(|(_, cast)| *cast).sum();
    let strongest = (ROUGHNESSES.iter())
        .filter_map(|&alpha| {
            let of_spot = |(own, _): &(Vec<(&SpotObservation, Gathered)>, Cast)| {
                differences(own, alpha, albedo)
            };
            let all: Vec<Vec<Difference>> = gathered.par_iter().map(of_spot).collect();
            strength(
                &all.into_iter().flatten().collect::<Vec<_>>(),
                gathered.len(),
            )
        })
        .fold(None, |most: Option<f64>, t| {
            Some(most.map_or(t, |m| m.max(t)))
        });
    (strongest, cast)
}

/// Of each observation of a spot: what sets it apart from the spot's mean, relative to the spot's level.
fn differences(own: &[(&SpotObservation, Gathered)], alpha: f64, albedo: DVec3) -> Vec<Difference> {
    let mut all: Vec<Difference> = (own.iter())
        .map(|(observation, light)| {
            let parts = light.parts(alpha);
            Difference {
                weight: observation.pixels.len() as f64,
                expected: lobed(&parts, albedo) - albedo * parts.diffuse,
                diffuse: parts.diffuse,
                shown: observation.measured,
            }
        })
        .collect();
    let weight: f64 = all.iter().map(|d| d.weight).sum();
    let mean = |of: &dyn Fn(&Difference) -> DVec3| {
        all.iter().map(|d| of(d) * d.weight).sum::<DVec3>() / weight
    };
    let (expected, diffuse, shown) = (
        mean(&|d| d.expected),
        mean(&|d| d.diffuse),
        mean(&|d| d.shown),
    );
    if shown.min_element() <= 0.0 || all.len() < 2 {
        return Vec::new();
    }
    for d in &mut all {
        d.expected = (d.expected - expected) / shown;
        d.diffuse = (d.diffuse - diffuse) / shown;
        d.shown = (d.shown - shown) / shown;
    }
    all
}

fn lobed(parts: &Parts, albedo: DVec3) -> DVec3 {
    (albedo * parts.base + parts.grazing) * (1.0 - SPECULAR) + parts.lobe * SPECULAR
}

/// The least-squares strength of the expected differences in those shown, in standard errors, beside what uneven light
/// within the spots explains.
fn strength(all: &[Difference], spots: usize) -> Option<f64> {
    let mut sizes: Vec<f64> = (all.iter())
        .map(|d| d.expected.abs().max_element())
        .collect();
    let most = DVec3::splat(CLIP * quantile(&mut sizes, 0.68)?);
    // Normal equations of two regressors.
    let (mut xx, mut xd, mut dd, mut xy, mut dy, mut yy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for difference in all {
        let (x, d, y) = (
            difference.expected.clamp(-most, most),
            difference.diffuse,
            difference.shown,
        );
        let w = difference.weight;
        xx += w * x.dot(x);
        xd += w * x.dot(d);
        dd += w * d.dot(d);
        xy += w * x.dot(y);
        dy += w * d.dot(y);
        yy += w * y.dot(y);
    }
    let (own, score) = if dd > 0.0 {
        (xx - xd * xd / dd, xy - xd * dy / dd)
    } else {
        (xx, xy)
    };
    let explained = if dd > 0.0 { dy * dy / dd } else { 0.0 };
    // The channels of a observation hardly differ: they count once.
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

    /// Differences that hold so much of what a lobe would make, under noise of 5 %.
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
                    shown: expected * strength + DVec3::splat(0.05 * centered()),
                }
            })
            .collect()
    }

    /// Standard scores: 40 of them stay below 4 but for one chance in 800.
    #[test]
    fn noise_speaks_for_no_lobe_and_a_lobe_for_itself() {
        for seed in 0..40 {
            let nothing = strength(&made(0.0, seed), 100).expect("enough sights");
            assert!(nothing.abs() < 4.0, "{nothing}");
        }
        let lobe = strength(&made(1.5, 50), 100).expect("enough sights");
        assert!(lobe > 5.0, "{lobe}");
    }
}
