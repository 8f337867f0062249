//! How well a fit explains the photographs, to compare fits with each other.

use crate::inverse::paths::PathCache;
use crate::inverse::paths::evaluate::Linearised;
use crate::inverse::unknowns::Unknowns;
use glam::DVec3;

/// Standard errors by which the squared error falls.
const FALL_ERRORS: f64 = 4.0;

/// The squared relative error of the model for each cluster of the fit, at most one, and the cluster's pixels. It is measured
/// across the two sets of paths, so that their noise adds nothing: sunlight that arrives after a bounce is much noisier than a lamp
/// that is seen.
pub(super) struct Misfit(Vec<(f64, f64)>);

impl Misfit {
    pub fn new(cache: &PathCache, unknowns: &Unknowns) -> Self {
        Self::of(cache, unknowns, |_| true)
    }

    /// The same over all objects but one.
    pub fn beside(cache: &PathCache, unknowns: &Unknowns, object: usize) -> Self {
        Self::of(cache, unknowns, |k| k != object)
    }

    fn of(cache: &PathCache, unknowns: &Unknowns, counts: impl Fn(usize) -> bool) -> Self {
        let of = |found: Linearised| {
            let [a, b] = found.residuals;
            let square = found.weight_now() * a * b / found.pixels;
            let square = square.clamp(DVec3::NEG_ONE, DVec3::ONE).element_sum() / 3.0;
            (square, found.pixels)
        };
        let residuals = cache.residuals(unknowns).into_iter();
        Self(
            residuals
                .filter(|found| counts(found.object as usize))
                .map(of)
                .collect(),
        )
    }

    pub fn mean(&self) -> f64 {
        let (sum, pixels) = (self.0.iter()).fold((0.0, 0.0), |(sum, all), (square, pixels)| {
            (sum + square * pixels, all + pixels)
        });
        sum / f64::max(pixels, 1.0)
    }

    /// Whether the mean of `other` is less by more than `needed` and by more than the noise of the difference.
    pub fn falls(&self, other: &Self, needed: f64) -> bool {
        let fall = self.mean() - other.mean();
        fall > needed && self.fall_in_errors(other) > FALL_ERRORS
    }

    /// How much less the mean of `other` is, in standard errors of the difference; zero if there is none.
    pub fn fall_in_errors(&self, other: &Self) -> f64 {
        let fall = self.mean() - other.mean();
        let (mut squares, mut pixels) = (0.0, 0.0);
        for ((before, weight), (after, _)) in self.0.iter().zip(&other.0) {
            squares += ((before - after - fall) * weight).powi(2);
            pixels += weight;
        }
        match squares > 0.0 {
            true => fall * pixels / squares.sqrt(),
            false => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Differences of 1, 2 and 3 over clusters of one pixel: their mean is 2, with a standard error of √2 / 3.
    #[test]
    fn a_fall_is_told_in_standard_errors_of_the_differences() {
        let [before, after] = [[4.0, 5.0, 6.0], [3.0, 3.0, 3.0]]
            .map(|squares| Misfit(squares.map(|square| (square, 1.0)).to_vec()));
        let errors = before.fall_in_errors(&after);
        assert!((errors - 2.0 * 3.0 / 2f64.sqrt()).abs() < 1e-12, "{errors}");
        assert!(before.falls(&after, 1.9) && !before.falls(&after, 2.1));
        assert!(before.fall_in_errors(&before) == 0.0 && !before.falls(&before, 0.0));
        assert!(!after.falls(&before, 0.0));
    }
}
