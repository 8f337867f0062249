//! Priors of the unknowns: wide normal distributions that keep undetermined unknowns at plausible values.

use crate::inverse::fit::sky_prior::SkyPrior;
use crate::inverse::known::Known;
use crate::inverse::sky::ExpectedSky;
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Standard deviation of an unknown albedo about [`ALBEDO_MEAN`].
pub const ALBEDO_DEVIATION: f32 = 0.5;
/// Standard deviation of the albedo of unseen objects. A uniform distribution from 0 to 1 has 0.29, and extreme albedos are rare.
pub const UNSEEN_DEVIATION: f32 = 0.25;
/// Mean of an unknown albedo.
pub const ALBEDO_MEAN: f32 = 0.5;
/// Standard deviation of outside radiance in a direction before a fit, in mean radiances of the photographs: what shines through
/// the windows of a modelled room.
const OUTSIDE_DEVIATION: f32 = 4.0;
/// The same for a scan. Its holes lead to the rest of the room, which is about as bright as what the photographs show.
const SCAN_DEVIATION: f32 = 1.0;
/// The same for a scan's sun, whose light is up to a thousand times that of a room: it is determined by what it falls on.
const SUN_DEVIATION: f32 = 1e3;

/// Standard deviation of each channel of outside radiance about its expected colour, relative to its brightness. Of 0.1 and 0.2 it
/// gives the smaller albedo error in rooms 1 to 12 of `relit demo --family window --seed N`, solved by `preview`.
const OUTSIDE_TINT: f32 = 0.1;
/// The same over the relative deviation of the brightness, where a direction is far from measured ones. From the horizon of a clear
/// sky to its zenith, colours change by a third of the brightness; part of that is extrapolated. With 0.5 the
/// worst tenth of these rooms has larger errors.
const DISTANT_TINT: f32 = 0.2;
/// The same where nothing shows the colour: each channel may be off by as much as the whole.
const UNKNOWN_TINT: f32 = 1.0;

/// Relative standard deviation of a known value: small enough that nothing moves it.
const KNOWN: f64 = 1e-12;

/// Normal distributions of albedos.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ExpectedAlbedo {
    /// Mean of each surface's albedo.
    pub mean: Vec<Vec3>,
    /// Standard deviation of each surface's albedo.
    pub deviation: Vec<Vec3>,
}

impl ExpectedAlbedo {
    /// The prior before any fit. `seen` is the number of pixels that see each surface; it may be shorter than `surfaces`.
    pub fn unknown(surfaces: usize, seen: &[u64]) -> Self {
        let deviation = |k: usize| match seen.get(k) {
            Some(0) => UNSEEN_DEVIATION,
            _ => ALBEDO_DEVIATION,
        };
        Self {
            mean: vec![Vec3::splat(ALBEDO_MEAN); surfaces],
            deviation: (0..surfaces).map(|k| Vec3::splat(deviation(k))).collect(),
        }
    }
}

/// Normal distributions of the unknowns; emissions of objects have none.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    surfaces: usize,
    /// The distributions of albedos.
    pub albedo: ExpectedAlbedo,
    /// Index of the first surface that stands for an outside direction.
    outside: usize,
    /// Mean and standard deviation of the radiance of each outside direction.
    pub directions: Vec<(Vec3, Vec3)>,
    /// Relative deviation of each outside direction's channels about its expected colour, once its brightness is fitted.
    tints: Vec<f32>,
    /// Mean radiance of all photographs.
    photographed: Vec3,
    scanned: bool,
    /// The joint distribution of the outside directions, where photographs show some of them.
    sky: Option<Arc<SkyPrior>>,
    known: BTreeMap<usize, Vec3>,
}

impl Prior {
    /// For `surfaces` surfaces, from index `outside` on outside directions; `photographed` is the mean radiance of all photographs.
    pub fn new(surfaces: usize, outside: usize, photographed: Vec3) -> Self {
        Self {
            surfaces,
            albedo: ExpectedAlbedo::unknown(surfaces, &[]),
            outside,
            directions: vec![(Vec3::ZERO, photographed * OUTSIDE_DEVIATION); surfaces - outside],
            tints: vec![OUTSIDE_TINT; surfaces - outside],
            photographed,
            scanned: false,
            sky: None,
            known: BTreeMap::new(),
        }
    }

    /// The prior with known values of some parameters.
    pub fn with_known(mut self, known: &Known) -> Self {
        for (k, pinned) in known.objects().filter(|(k, _)| *k < self.outside) {
            let albedo = pinned.albedo.map(|albedo| (k, albedo));
            let emission = pinned
                .emission
                .map(|emission| (self.surfaces + k, emission));
            self.known.extend(albedo.into_iter().chain(emission));
        }
        self
    }

    /// Resets a surface's albedo to the unknown distribution.
    pub fn forget_albedo(&mut self, surface: usize) {
        self.albedo.mean[surface] = Vec3::splat(ALBEDO_MEAN);
        self.albedo.deviation[surface] = Vec3::splat(ALBEDO_DEVIATION);
    }

    /// The prior of a scan: outside directions are about as bright as the rest of the room. The last surface is the sun's.
    pub fn of_scan(mut self) -> Self {
        self.scanned = true;
        let deviation = self.photographed * SCAN_DEVIATION;
        self.directions.fill((Vec3::ZERO, deviation));
        if let Some(sun) = self.directions.last_mut() {
            sun.1 = self.photographed * SUN_DEVIATION;
        }
        self
    }

    /// The joint distribution of the outside directions, and the index of the first one's emission among all parameters.
    pub fn sky(&self) -> Option<(&SkyPrior, usize)> {
        let sky = self.sky.as_deref()?;
        Some((sky, self.surfaces + self.outside))
    }

    /// The prior with what is expected of outside directions: their joint distribution, where that is known. Otherwise, and for light that no photograph shows by itself, as behind saturated pixels, a direction may be off by as much as
    /// its mean, and in a modelled room by as much as the brightest of them: one sky shines through all windows.
    pub fn with_sky(mut self, sky: Option<&ExpectedSky>) -> Self {
        let mut brightest = Vec3::ZERO;
        let directions = self.directions.iter_mut().zip(&mut self.tints);
        for (d, ((mean, deviation), tint)) in directions.enumerate() {
            *mean = sky
                .and_then(|sky| sky.radiance.get(d).copied())
                .unwrap_or_default();
            *tint = match sky.and_then(|sky| sky.has_color.get(d)) {
                Some(true) => OUTSIDE_TINT,
                _ => UNKNOWN_TINT,
            };
            *deviation = deviation.max(*mean);
            brightest = brightest.max(*deviation);
        }
        if !self.scanned {
            for (_, deviation) in &mut self.directions {
                *deviation = brightest;
            }
        }
        self.sky = sky.and_then(|sky| {
            let covariance = sky.covariance.clone()?;
            let tint = |d: usize| {
                let variance = covariance[(d, d)].max(0.0) as f32;
                // The mean square of the brightness is one and its variance.
                OUTSIDE_TINT.hypot(DISTANT_TINT * variance.sqrt()) * (1.0 + variance).sqrt()
            };
            Some(Arc::new(SkyPrior {
                radiance: sky.radiance.clone(),
                tint: (0..sky.radiance.len()).map(tint).collect(),
                covariance,
            }))
        });
        self
    }

    /// The prior with outside light held near its expected colour, at its fitted brightness.
    ///
    /// The effect of a direction on the room may determine little more than its brightness, and channels fitted independently
    /// would give colours from noise. `found` gives the fitted radiance and its standard error by surface; `color` gives the
    /// expected colour, from the surface and its previous mean, or `None` for a surface whose prior stays.
    pub fn with_outside_found(
        mut self,
        found: impl Fn(usize) -> (Vec3, Vec3),
        color: impl Fn(u32, Vec3) -> Option<Vec3>,
    ) -> Self {
        let directions = self.directions.iter_mut().zip(&self.tints);
        let mut expected: Vec<_> = (self.outside..)
            .zip(directions)
            .filter_map(|(surface, (direction, tint))| {
                let color = color(surface as u32, direction.0)?;
                let (radiance, error) = found(surface);
                direction.0 = color * brightness(color, radiance, error);
                Some((direction, tint))
            })
            .collect();
        // A direction that was fitted black may still be as bright as a part of what shines elsewhere.
        let sum: Vec3 = expected.iter().map(|(direction, _)| direction.0).sum();
        let least = self.photographed.max(sum / expected.len().max(1) as f32);
        for ((mean, deviation), tint) in &mut expected {
            *deviation = mean.max(least) * **tint;
        }
        self
    }

    /// Mean and precision of a parameter (albedos first, then emissions). The precision is in the units of the normal equations:
    /// the noise variance of one cluster over the prior's variance. Both are zero for parameters without a prior.
    pub fn of(&self, parameter: usize, noise: DVec3) -> (DVec3, DVec3) {
        if let Some(value) = self.known.get(&parameter) {
            // The scale of the parameter, for known values of zero.
            let unit = match parameter < self.surfaces {
                true => Vec3::ONE,
                false => self.photographed,
            };
            let deviation = value.max(unit).as_dvec3() * KNOWN;
            let precision = (noise / (deviation * deviation)).min(DVec3::splat(f64::MAX));
            return (value.as_dvec3(), precision);
        }
        let (mean, deviation) = match parameter.checked_sub(self.surfaces) {
            None => (
                self.albedo.mean[parameter],
                self.albedo.deviation[parameter],
            ),
            Some(emitter) if emitter >= self.outside => self.directions[emitter - self.outside],
            Some(_) => return (DVec3::ZERO, DVec3::ZERO),
        };
        let (mean, deviation) = (mean.as_dvec3(), deviation.as_dvec3());
        let known = deviation.cmpgt(DVec3::ZERO);
        let or_zero = |v| DVec3::select(known, v, DVec3::ZERO);
        (or_zero(mean), or_zero(noise / (deviation * deviation)))
    }
}

/// The multiple of a colour that fits a radiance best, weighted by the radiance's standard errors.
fn brightness(color: Vec3, radiance: Vec3, error: Vec3) -> f32 {
    let weight = (error * error).recip();
    let known = weight.is_finite_mask() & color.cmpgt(Vec3::ZERO);
    let weight = Vec3::select(known, weight, Vec3::ZERO);
    let (top, bottom) = ((weight * color).dot(radiance), (weight * color).dot(color));
    if bottom > 0.0 {
        (top / bottom).max(0.0)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_expected_albedo_weighs_by_its_own_deviation() {
        let expected = ExpectedAlbedo {
            mean: vec![Vec3::new(0.2, 0.3, 0.4)],
            deviation: vec![Vec3::new(0.1, 0.01, 0.5)],
        };
        let mut prior = Prior::new(1, 1, Vec3::ONE);
        prior.albedo = expected;
        let (mean, precision) = prior.of(0, DVec3::ONE);
        assert!((mean - DVec3::new(0.2, 0.3, 0.4)).length() < 1e-6, "{mean}");
        let ratio = precision / DVec3::new(100.0, 1e4, 4.0);
        assert!((ratio - DVec3::ONE).length() < 1e-5, "{precision}");
        let nothing = Prior::new(1, 1, Vec3::ONE).of(0, DVec3::ONE);
        assert_eq!(nothing, (DVec3::splat(0.5), DVec3::splat(4.0)));
    }

    /// A sky of these radiances.
    fn sky(radiance: &[f32]) -> ExpectedSky {
        ExpectedSky {
            radiance: radiance.iter().copied().map(Vec3::splat).collect(),
            covariance: None,
            has_color: vec![true; radiance.len()],
            shape: Vec::new(),
        }
    }

    #[test]
    fn light_found_outside_is_held_near_the_colour_expected_of_it() {
        let color = Vec3::new(1.0, 2.0, 4.0);
        // Three times the colour, but for a channel that hardly counts.
        let found = (Vec3::new(3.0, 6.0, 40.0), Vec3::new(0.1, 0.1, 30.0));
        let prior =
            Prior::new(2, 1, Vec3::splat(0.1)).with_outside_found(|_| found, |_, _| Some(color));
        let (mean, precision) = prior.of(3, DVec3::ONE);
        let ratio = mean / color.as_dvec3();
        assert!(ratio.abs_diff_eq(DVec3::splat(3.0), 1e-2));
        let deviation = precision.powf(-0.5) / mean;
        assert!((deviation - f64::from(OUTSIDE_TINT)).abs().max_element() < 1e-6);
        // Dark ones may still be something.
        let dark = Prior::new(2, 1, Vec3::ONE)
            .with_outside_found(|_| (Vec3::ZERO, Vec3::ONE), |_, _| Some(color));
        let (mean, precision) = dark.of(3, DVec3::ONE);
        assert!(mean == DVec3::ZERO && precision.is_finite() && precision.x > 0.0);
        assert_eq!(brightness(color, Vec3::ONE, Vec3::INFINITY), 0.0);
        // ... and more where light that is much brighter than the photographs shines beside them: 8, 0 and 16, whose mean is 8.
        let bright = |surface| Vec3::splat([8.0, 0.0, 16.0][surface - 1]);
        let beside = Prior::new(4, 1, Vec3::ONE)
            .with_outside_found(|k| (bright(k), Vec3::ONE), |_, _| Some(Vec3::ONE));
        for (parameter, expected) in [(5, 8.0), (6, 8.0), (7, 16.0)] {
            let deviation = beside.of(parameter, DVec3::ONE).1.x.powf(-0.5);
            assert!((deviation / (expected * f64::from(OUTSIDE_TINT)) - 1.0).abs() < 1e-5);
        }
        // Light of unknown colour may be any.
        let unknown = Prior::new(2, 1, Vec3::splat(0.1))
            .with_sky(None)
            .with_outside_found(|_| found, |_, _| Some(color));
        let (mean, precision) = unknown.of(3, DVec3::ONE);
        assert!((precision * mean * mean - DVec3::ONE).length() < 1e-4);
    }

    #[test]
    fn lamps_are_free_and_the_outside_is_held_near_what_was_seen_in_any_unit() {
        for unit in [1e-12f32, 1.0, 1e12] {
            let prior = Prior::new(5, 3, Vec3::splat(2.0 * unit))
                .with_sky(Some(&sky(&[3.0 * unit, 3.0 * unit])));
            let noise = DVec3::splat(0.1);
            assert_eq!(prior.of(0, noise), (DVec3::splat(0.5), noise / 0.25));
            assert_eq!(prior.of(5 + 2, noise), (DVec3::ZERO, DVec3::ZERO));
            let (mean, precision) = prior.of(5 + 3, noise);
            let unit = f64::from(unit);
            assert!((mean / unit - DVec3::splat(3.0)).length() < 1e-5);
            assert!((precision * unit.powi(2) - noise / 64.0).length() < 1e-8);
        }
        // In a scan each direction is held to its own mean, and no tighter than to the photographs; the sun is as good as free.
        let scan = Prior::new(6, 3, Vec3::splat(2.0)).of_scan();
        let scan = scan.with_sky(Some(&sky(&[0.5, 5.0])));
        for (surface, deviation) in [(3, 2.0f64), (4, 5.0), (5, 2000.0)] {
            let (_, precision) = scan.of(6 + surface, DVec3::ONE);
            assert!((precision * deviation.powi(2) - DVec3::ONE).length() < 1e-6);
        }
        // All photographs black: nothing to hold on to.
        let black = Prior::new(2, 1, Vec3::ZERO).of(3, DVec3::splat(0.1));
        assert_eq!(black, (DVec3::ZERO, DVec3::ZERO));
    }
}
