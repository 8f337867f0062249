//! The common factor of all albedos, which the photographs of a scan leave nearly open.
//!
//! If all lamps are saturated, the photographs measure only the product of albedo and light. Interreflections separate the two, but
//! their error is the error of the mesh: rough surfaces absorb light and holes lose it, so that albedos come out too high. The
//! factor is therefore a compromise between the fit and a population of rooms, weighed by their variances.

/// Median over rooms of the area-weighted mean albedo. Lighting practice (useful reflectances in EN 12464-1) takes 0.7 to 0.9 for
/// ceilings, 0.5 to 0.8 for walls and 0.2 to 0.4 for floors, about 0.6 for the shell; furniture is darker.
const TYPICAL: f64 = 0.5;
/// Standard deviation of its logarithm, an assumption: two of three rooms lie between 0.37 and 0.67.
const SPREAD: f64 = 0.3;

/// The most likely factor on all albedos, given the fitted mean albedo and its relative standard error: the precision-weighted mean
/// of both logarithms.
pub fn likeliest(found: f64, error: f64) -> f64 {
    let weight = error * error / (error * error + SPREAD * SPREAD);
    let factor = (weight * (TYPICAL / found).ln()).exp();
    if factor.is_finite() { factor } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sound_model_is_believed_and_a_doubtful_one_drawn_to_what_rooms_are_like() {
        assert_eq!(likeliest(0.8, 0.0), 1.0);
        assert!((likeliest(0.8, 0.01) - 1.0).abs() < 1e-3);
        // As doubtful as rooms are different: half the way, in the logarithm.
        let factor = likeliest(0.8, SPREAD);
        assert!(
            (0.8 * factor - (0.8f64 * TYPICAL).sqrt()).abs() < 1e-9,
            "{factor}"
        );
        assert!((likeliest(0.25, 1e6) - 2.0).abs() < 1e-6);
        assert_eq!(likeliest(0.0, 0.3), 1.0);
    }
}
