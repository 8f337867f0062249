//! Counts lamps that were found, and objects that were mistaken for lamps.

use crate::math::color::luminance_f64;
use crate::study::evaluate::ObjectErrors;
use crate::transport::environment::Environment;
use glam::DVec3;

/// Largest factor between the estimated and the true emission of a lamp that counts as found.
const FACTOR: f64 = 2.0;
/// An object without emission is a false lamp above this fraction of the largest true emission.
const FALSE_FRACTION: f64 = 0.01;

/// Numbers of lamps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Lamps {
    /// True lamps.
    pub true_count: u64,
    /// True lamps whose brightness was found.
    pub found: u64,
    /// False lamps: objects without emission that were given one.
    pub false_count: u64,
}

/// Counts lamps by luminance. Without true lamps, false ones are measured against the mean radiance from outside.
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
            lamps.true_count += 1;
            lamps.found += u64::from(estimated <= FACTOR * known && known <= FACTOR * estimated);
        } else {
            lamps.false_count += u64::from(estimated > FALSE_FRACTION * brightest);
        }
    }
    lamps
}

#[cfg(test)]
mod tests {
    use super::*;

    fn object(emission: f64, known: f64) -> (String, ObjectErrors) {
        let errors = ObjectErrors {
            emitter: known > 0.0,
            emission: [emission; 3],
            emission_true: [known; 3],
            ..ObjectErrors::default()
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
            true_count: 4,
            found: 2,
            false_count: 1,
        };
        assert_eq!(count(&objects, None), expected);
        let sky = Environment::new(4, 2, vec![glam::Vec3::ONE; 8]);
        let dark = [object(0.02, 0.0), object(0.005, 0.0)];
        assert_eq!(count(&dark, sky.as_ref()).false_count, 1);
    }
}
