//! Running means and variances, and quantiles, in f64.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Running mean and variance (Welford 1962), mergeable (Chan et al. 1979).
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Moments {
    /// Number of samples.
    pub count: u64,
    /// Mean of the samples.
    pub mean: f64,
    /// Sum of squared deviations from the mean.
    pub sum_squares: f64,
}

impl FromIterator<f64> for Moments {
    fn from_iter<I: IntoIterator<Item = f64>>(samples: I) -> Self {
        samples.into_iter().fold(Self::default(), |mut all, x| {
            all.push(x);
            all
        })
    }
}

/// Values beyond this multiple of the 68th percentile of the magnitudes are clamped to it.
const CLIP: f64 = 5.0;

/// The values with outliers clamped, so that a few do not decide about their mean.
pub fn without_outliers(values: &[f64]) -> Vec<f64> {
    let mut sizes: Vec<f64> = values.iter().map(|v| v.abs()).collect();
    let clip = CLIP * quantile(&mut sizes, 0.68).unwrap_or(0.0);
    values.iter().map(|v| v.clamp(-clip, clip)).collect()
}

impl Moments {
    /// Adds one sample.
    pub fn push(&mut self, x: f64) {
        self.count += 1;
        let delta = x - self.mean;
        self.mean += delta / self.count as f64;
        self.sum_squares += delta * (x - self.mean);
    }

    /// Adds all samples of another set.
    pub fn merge(&mut self, other: &Self) {
        if other.count == 0 {
            return;
        }
        let total = self.count + other.count;
        let delta = other.mean - self.mean;
        let fraction = other.count as f64 / total as f64;
        self.mean += delta * fraction;
        self.sum_squares += other.sum_squares + delta * delta * self.count as f64 * fraction;
        self.count = total;
    }

    /// Unbiased variance of one sample; zero for fewer than two.
    pub fn variance(&self) -> f64 {
        if self.count < 2 {
            0.0
        } else {
            self.sum_squares / (self.count - 1) as f64
        }
    }

    /// Standard error of the mean; infinite for fewer than two samples.
    pub fn standard_error(&self) -> f64 {
        if self.count < 2 {
            f64::INFINITY
        } else {
            (self.variance() / self.count as f64).sqrt()
        }
    }
}

/// The `q` quantile (0 … 1) of finite values, linear between ranks; `None` if there are none. Sorts in place.
pub fn quantile(values: &mut [f64], q: f64) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    values.sort_by(f64::total_cmp);
    let rank = q.clamp(0.0, 1.0) * (values.len() - 1) as f64;
    let low = rank.floor() as usize;
    let high = rank.ceil() as usize;
    Some(values[low] + (values[high] - values[low]) * (rank - low as f64))
}

/// The median of each channel; zero without values.
pub fn medians(values: impl Iterator<Item = DVec3>) -> DVec3 {
    let all: Vec<DVec3> = values.collect();
    DVec3::from_array(std::array::from_fn(|channel| {
        let mut values: Vec<f64> = all.iter().map(|v| v[channel]).collect();
        quantile(&mut values, 0.5).unwrap_or(0.0)
    }))
}

/// The value, of those with a weight, up to which half of the weight lies; `None` without weight.
pub fn weighted_median(mut values: Vec<(f64, f64)>) -> Option<f64> {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = values.iter().map(|(_, weight)| weight).sum::<f64>() / 2.0;
    let mut below = 0.0;
    let middle = values.iter().find(|(_, weight)| {
        below += weight;
        *weight > 0.0 && below >= half
    });
    middle.map(|(value, _)| *value)
}

/// The upper median; `None` without values. Reorders in place.
pub fn upper_median(values: &mut [f32]) -> Option<f32> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

/// Pearson's test of counts against the expected ones, as a normal deviate: 3.72 is as rare as one in 10⁴, 4.27 as one in 10⁵.
///
/// Cells that expect fewer than `min` are pooled; where the pool does so too and yet holds six standard errors more, the result is
/// infinite. ∛(χ²/k) of k degrees of freedom is nearly normal with mean 1 − 2/9k and variance 2/9k (Wilson and Hilferty 1931).
pub fn pearson_deviate(observed: &[f64], expected: &[f64], min: f64) -> f64 {
    let square = |o: f64, e: f64| (o - e).powi(2) / e;
    let (mut squares, mut cells, mut pool) = (0.0, 0.0, (0.0, 0.0));
    for (&o, &e) in observed.iter().zip(expected) {
        if e < min {
            pool = (pool.0 + o, pool.1 + e);
        } else {
            squares += square(o, e);
            cells += 1.0;
        }
    }
    if pool.1 > min {
        squares += square(pool.0, pool.1);
        cells += 1.0;
    } else if pool.0 > min + 6.0 * min.sqrt() {
        return f64::INFINITY;
    }
    let freedom = cells - 1.0;
    let variance = 2.0 / (9.0 * freedom);
    ((squares / freedom).cbrt() - (1.0 - variance)) / variance.sqrt()
}

/// Pearson's chi-square of counts in cells of equal probability.
#[cfg(test)]
pub(super) fn chi_square(cells: &[u32]) -> f64 {
    let expected = f64::from(cells.iter().sum::<u32>()) / cells.len() as f64;
    let squares = cells.iter().map(|&n| (f64::from(n) - expected).powi(2));
    squares.sum::<f64>() / expected
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outliers_are_clamped_to_five_times_the_68th_percentile() {
        let mut values: Vec<f64> = (0..100).map(|i| f64::from(i % 2) - 0.5).collect();
        values.extend([90.0, -70.0]);
        let kept = without_outliers(&values);
        assert_eq!(kept[..100], values[..100]);
        assert_eq!(kept[100..], [2.5, -2.5]);
    }

    #[test]
    fn deviates_are_those_of_tabled_chi_squares() {
        // Of 10 and 200 degrees of freedom, χ² is above 29.588 and 267.54 once in 10³: 3.090 of a normal.
        for (freedom, tabled) in [(10usize, 29.588), (200, 267.541)] {
            let expected = vec![100.0; freedom + 1];
            let mut observed = expected.clone();
            observed[0] += (tabled * 100.0f64).sqrt();
            let found = pearson_deviate(&observed, &expected, 5.0);
            assert!((found - 3.090).abs() < 0.02, "{freedom}: {found}");
        }
        // Pooled: three cells of 3 hold what one of 9 does, and a cell that expects nothing may hold little.
        let pooled = |last: [f64; 3]| {
            let observed = [&[100.0, 100.0][..], &last].concat();
            pearson_deviate(&observed, &[100.0, 100.0, 3.0, 3.0, 3.0], 5.0)
        };
        assert_eq!(pooled([9.0, 0.0, 0.0]), pooled([3.0, 3.0, 3.0]));
        let lost = |last| pearson_deviate(&[100.0, 100.0, last], &[100.0, 100.0, 0.0], 5.0);
        assert!(lost(18.0).is_finite() && lost(19.0).is_infinite());
    }

    #[test]
    fn merged_moments_equal_those_of_all_samples() {
        let xs: Vec<f64> = (0..100).map(|i| ((i * 37) % 101) as f64 + 1e6).collect();
        let of = |xs: &[f64]| xs.iter().copied().collect::<Moments>();
        let (all, mut a) = (of(&xs), of(&xs[..33]));
        a.merge(&of(&xs[33..]));
        assert_eq!(a.count, all.count);
        assert!((a.mean - all.mean).abs() < 1e-9);
        assert!((a.variance() - all.variance()).abs() < 1e-6);
        let mean = xs.iter().sum::<f64>() / 100.0;
        let variance = xs.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 99.0;
        assert!((all.variance() - variance).abs() < 1e-6);
    }

    #[test]
    fn quantiles_interpolate_between_ranks() {
        assert_eq!(quantile(&mut [3.0, 1.0, 2.0], 0.5), Some(2.0));
        assert_eq!(quantile(&mut [0.0, 10.0], 0.95), Some(9.5));
        assert_eq!(quantile(&mut [], 0.5), None);
    }
}
