//! Skies from overcast to clear: the CIE standard general sky (CIE S 011/E:2003), with colours.

use glam::Vec3;
use std::f32::consts::FRAC_PI_2;

/// The parameters a, b of the gradation from the horizon to the zenith, and c, d, e of the indicatrix around the sun, of the 15
/// standard skies (CIE S 011/E:2003, table 1).
const SKIES: [[f32; 5]; 15] = [
    [4.0, -0.70, 0.0, -1.0, 0.0],
    [4.0, -0.70, 2.0, -1.5, 0.15],
    [1.1, -0.8, 0.0, -1.0, 0.0],
    [1.1, -0.8, 2.0, -1.5, 0.15],
    [0.0, -1.0, 0.0, -1.0, 0.0],
    [0.0, -1.0, 2.0, -1.5, 0.15],
    [0.0, -1.0, 5.0, -2.5, 0.30],
    [0.0, -1.0, 10.0, -3.0, 0.45],
    [-1.0, -0.55, 2.0, -1.5, 0.15],
    [-1.0, -0.55, 5.0, -2.5, 0.30],
    [-1.0, -0.55, 10.0, -3.0, 0.45],
    [-1.0, -0.32, 10.0, -3.0, 0.45],
    [-1.0, -0.32, 16.0, -3.0, 0.30],
    [-1.0, -0.15, 16.0, -3.0, 0.30],
    [-1.0, -0.15, 24.0, -2.8, 0.15],
];
/// Number of skies to choose from.
pub const KINDS: usize = SKIES.len();
/// Least sine of the elevation, where the gradation ends.
const HORIZON: f32 = 0.02;

/// A sky of a kind below [`KINDS`] and the unit direction of its sun.
pub struct Sky {
    /// Its kind.
    pub kind: usize,
    /// The unit direction of the sun, which itself is not part of the sky.
    pub sun: Vec3,
}

impl Sky {
    /// Luminance in a unit direction above the horizon (y > 0), relative to no fixed level: gradation times indicatrix.
    pub fn luminance(&self, direction: Vec3) -> f32 {
        let [a, b, c, d, e] = SKIES[self.kind];
        let gradation = 1.0 + a * (b / direction.y.max(HORIZON)).exp();
        let angle = direction.dot(self.sun).clamp(-1.0, 1.0).acos();
        let indicatrix =
            1.0 + c * ((d * angle).exp() - (d * FRAC_PI_2).exp()) + e * angle.cos().powi(2);
        gradation * indicatrix
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skies_are_those_of_the_standard() {
        let sky = |kind, sun| Sky { kind, sun };
        // The overcast sky: 1/3 of the zenith's luminance at the horizon, (1 + 2 sin γ)/3 of it between within 7 %.
        let overcast = sky(0, Vec3::X);
        let zenith = overcast.luminance(Vec3::Y);
        for rise in [0.02f32, 0.3, 0.6, 0.9] {
            let direction = Vec3::new((1.0 - rise * rise).sqrt(), rise, 0.0);
            let ratio = overcast.luminance(direction) / zenith;
            assert!(
                (ratio - (1.0 + 2.0 * rise) / 3.0).abs() < 0.07,
                "{rise} {ratio}"
            );
        }
        // The uniform sky.
        assert_eq!(
            sky(4, Vec3::X).luminance(Vec3::Y),
            sky(4, Vec3::Y).luminance(Vec3::X + Vec3::Y)
        );
        // A clear sky is brightest around the sun and all are positive.
        let sun = Vec3::new(0.6, 0.8, 0.0);
        for kind in 0..KINDS {
            for turn in 0..64 {
                let (sin, cos) = (turn as f32 * 0.1).sin_cos();
                let rise = 0.02 + 0.015 * turn as f32;
                let direction = Vec3::new(cos, rise, sin).normalize();
                let luminance = sky(kind, sun).luminance(direction);
                assert!(luminance > 0.0, "{kind} {direction}");
            }
        }
        let clear = sky(11, sun);
        assert!(clear.luminance(sun) > 5.0 * clear.luminance(Vec3::new(-0.6, 0.8, 0.0)));
    }
}
