//! Lamps that were found, and objects that were taken for lamps.

use crate::math::color::luminance_f64;
use crate::study::evaluate::ObjectErrors;
use crate::transport::environment::Environment;
use glam::DVec3;

/// Largest factor between the emission of a lamp that counts as found and the true one.
const FACTOR: f64 = 2.0;
/// Fraction of the brightest true emission that makes a lamp of what is none.
const FALSE: f64 = 0.01;

/// Numbers of lamps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Lamps {
    /// Lamps that there are.
    pub there: u64,
    /// Of them, those whose brightness was found.
    pub found: u64,
    /// Objects that are none and were given light.
    pub made_up: u64,
}

/// Counts lamps by luminance. Where there is no lamp, the mean radiance from outside takes the place of the brightest emission.
pub fn count(errors: &[(String, ObjectErrors)], outside: Option<&Environment>) -> Lamps {
    let light = |emission: [f64; 3]| luminance_f64(DVec3::from(emission));
    let lamps = errors.iter().filter(|(_, errors)| errors.emitter);
    let brightest = lamps.map(|(_, errors)| light(errors.emission_true));
    let sky = || outside.map_or(0.0, |map| map.power() / (4.0 * std::f64::consts::PI));
    let brightest = brightest.reduce(f64::max).unwrap_or_else(sky);
    let mut lamps = Lamps::default();
    for (_, errors) in errors {
        let [estimated, known] = [errors.emission, errors.emission_true].map(light);
        if errors.emitter {
            lamps.there += 1;
            lamps.found += u64::from(estimated <= FACTOR * known && known <= FACTOR * estimated);
        } else {
            lamps.made_up += u64::from(estimated > FALSE * brightest);
        }
    }
    lamps
}

#[cfg(test)]
mod tests {
    use super::*;

    fn object(emission: f64, known: f64) -> (String, ObjectErrors) {
        let errors = ObjectErrors {
            pixels: 0,
            emitter: known > 0.0,
            textured: false,
            scored: false,
            albedo: [0.0; 3],
            albedo_true: None,
            albedo_rel: None,
            emission: [emission; 3],
            emission_true: [known; 3],
            emission_rel: None,
        };
        (String::new(), errors)
    }

    #[test]
    fn a_factor_of_two_is_found_and_a_hundredth_of_the_brightest_is_made_up() {
        let objects = [
            object(5.1, 10.0),
            object(4.9, 10.0),
            object(19.9, 10.0),
            object(20.1, 10.0),
            object(0.11, 0.0),
            object(0.09, 0.0),
        ];
        let expected = Lamps {
            there: 4,
            found: 2,
            made_up: 1,
        };
        assert_eq!(count(&objects, None), expected);
        let sky = Environment::new(4, 2, vec![glam::Vec3::ONE; 8]);
        let dark = [object(0.02, 0.0), object(0.005, 0.0)];
        assert_eq!(count(&dark, sky.as_ref()).made_up, 1);
    }
}
