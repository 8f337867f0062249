//! What is believed of an unknown before any photograph speaks: little, but enough to keep what no photograph
//! determines within reason.

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Standard deviation of an albedo of which nothing is known, about [`ALBEDO_MEAN`].
pub const ALBEDO_DEVIATION: f64 = 0.5;
/// Where an albedo stays of which nothing is known.
pub const ALBEDO_MEAN: f64 = 0.5;
/// Standard deviation of light from a direction outside that no photograph looks in, in mean radiances of what the
/// photographs show.
const OUTSIDE_DEVIATION: f32 = 4.0;

/// Normal distributions of albedos.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ExpectedAlbedo {
    /// One for each surface.
    pub mean: Vec<Vec3>,
    /// Standard deviations.
    pub deviation: Vec<Vec3>,
}

/// Normal distributions of the unknowns; nothing is believed of a lamp.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    surfaces: usize,
    albedo: Option<ExpectedAlbedo>,
    /// First of the surfaces that stand for directions outside.
    outside: usize,
    /// One for each of those.
    means: Vec<Vec3>,
    deviation: Vec3,
}

impl Prior {
    /// For `surfaces` surfaces of which those from `outside` on stand for directions outside; `photographed` is the mean
    /// radiance of all photographs.
    pub fn new(surfaces: usize, outside: usize, photographed: Vec3) -> Self {
        Self {
            surfaces,
            albedo: None,
            outside,
            means: vec![Vec3::ZERO; surfaces - outside],
            deviation: photographed * OUTSIDE_DEVIATION,
        }
    }

    /// The same with what to expect of each surface's albedo.
    pub fn with_albedo(mut self, albedo: Option<ExpectedAlbedo>) -> Self {
        self.albedo = albedo;
        self
    }

    /// What is expected of the albedos, if anything was found.
    pub fn albedo(&self) -> Option<&ExpectedAlbedo> {
        self.albedo.as_ref()
    }

    /// The same with what to expect of each direction outside, from what was seen of others.
    pub fn with_sky(mut self, expected: impl Fn(u32) -> Vec3) -> Self {
        for (surface, mean) in (self.outside as u32..).zip(&mut self.means) {
            *mean = expected(surface);
            self.deviation = self.deviation.max(*mean);
        }
        self
    }

    /// Mean of a parameter (albedos first, then emissions) in one channel, and its precision in the units of the normal
    /// equations: the noise variance of one cluster over the prior's variance. Zero where nothing is believed.
    pub fn of(&self, parameter: usize, channel: usize, noise: f64) -> (f64, f64) {
        match parameter.checked_sub(self.surfaces) {
            None => {
                let (mean, deviation) = match &self.albedo {
                    Some(expected) => (
                        f64::from(expected.mean[parameter][channel]),
                        f64::from(expected.deviation[parameter][channel]),
                    ),
                    None => (ALBEDO_MEAN, ALBEDO_DEVIATION),
                };
                (mean, noise / (deviation * deviation))
            }
            Some(emitter) if emitter >= self.outside && self.deviation[channel] > 0.0 => {
                let deviation = f64::from(self.deviation[channel]);
                (
                    f64::from(self.means[emitter - self.outside][channel]),
                    noise / (deviation * deviation),
                )
            }
            Some(_) => (0.0, 0.0),
        }
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
        let prior = Prior::new(1, 1, Vec3::ONE).with_albedo(Some(expected));
        for (channel, (mean, precision)) in [(0.2, 100.0), (0.3, 1e4), (0.4, 4.0)]
            .into_iter()
            .enumerate()
        {
            let of = prior.of(0, channel, 1.0);
            assert!((of.0 - mean).abs() < 1e-6, "{of:?}");
            assert!((of.1 / precision - 1.0).abs() < 1e-5, "{of:?}");
        }
        assert_eq!(prior.with_albedo(None).of(0, 0, 1.0), (0.5, 4.0));
    }

    #[test]
    fn lamps_are_free_and_the_outside_is_held_near_what_was_seen_in_any_unit() {
        for unit in [1e-12f32, 1.0, 1e12] {
            let prior =
                Prior::new(5, 3, Vec3::splat(2.0 * unit)).with_sky(|_| Vec3::splat(3.0 * unit));
            assert_eq!(prior.of(0, 0, 0.1), (0.5, 0.1 / 0.25));
            assert_eq!(prior.of(5 + 2, 0, 0.1), (0.0, 0.0));
            let (mean, precision) = prior.of(5 + 3, 1, 0.1);
            assert!((mean / f64::from(unit) - 3.0).abs() < 1e-5);
            assert!((precision * f64::from(unit).powi(2) - 0.1 / 64.0).abs() < 1e-8);
        }
        // All photographs black: nothing to hold on to.
        assert_eq!(Prior::new(2, 1, Vec3::ZERO).of(3, 0, 0.1), (0.0, 0.0));
    }
}
