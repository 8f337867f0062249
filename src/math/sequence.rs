//! Random numbers of paths: independent, or points of a low-discrepancy sequence shared by many paths.

use crate::math::rng::{Stream, splitmix64};

/// Points of a sequence before a new scramble is used.
const LENGTH: u64 = 1 << 16;
/// Groups of four numbers per path from the sequence; later groups are independent numbers.
const GROUPS: u32 = 10;
/// Spacing of the sequence's f32 numbers, and of [`Stream`]'s.
const SPACING: [f64; 2] = [1.0 / 8_388_608.0, 1.0 / 16_777_216.0];

/// A source of the uniform numbers in [0, 1) of one path, in order of use.
pub trait Uniforms {
    /// The next four numbers.
    fn four(&mut self) -> [f32; 4];

    /// Extends `coarse`, one of the last four numbers, by random lower-order bits, for choices among very unequal probabilities:
    /// the result is uniform over the interval that rounds down to `coarse`.
    fn refine(&mut self, coarse: f32) -> f64;
}

impl Uniforms for Stream {
    #[inline]
    fn four(&mut self) -> [f32; 4] {
        std::array::from_fn(|_| self.uniform())
    }

    #[inline]
    fn refine(&mut self, coarse: f32) -> f64 {
        f64::from(coarse) + self.uniform_f64() * SPACING[1]
    }
}

/// One point of an Owen-scrambled Sobol sequence (Burley 2020, "Practical Hash-Based Owen Scrambling"). Each point
/// is uniform, so means over points are unbiased; together they are stratified, so the mean of a smooth function over
/// many has far less variance than with independent points.
#[derive(Debug, Clone)]
pub struct SequencePoint {
    index: u32,
    scramble: u32,
    group: u32,
    /// Whether the last four numbers came from `independent`.
    is_independent: bool,
    /// The numbers after the sequence's groups.
    independent: Stream,
}

impl SequencePoint {
    /// Point `index` of the sequence with a (seed, [frame, pixel, set]) key. Sequences of different keys are independent.
    pub fn new(seed: u64, key: [u64; 3], index: u64) -> Self {
        let [frame, pixel, set] = key;
        let mut scramble = splitmix64(seed);
        for k in [frame, pixel, set, index / LENGTH] {
            scramble = splitmix64(scramble ^ k);
        }
        Self {
            index: (index % LENGTH) as u32,
            scramble: (scramble >> 32) as u32,
            group: 0,
            is_independent: false,
            independent: Stream::new(scramble, frame, pixel, index),
        }
    }
}

impl Uniforms for SequencePoint {
    #[inline]
    fn four(&mut self) -> [f32; 4] {
        if self.group == GROUPS {
            self.is_independent = true;
            return self.independent.four();
        }
        self.group += 1;
        sobol_burley::sample_4d(self.index, self.group - 1, self.scramble)
    }

    #[inline]
    fn refine(&mut self, coarse: f32) -> f64 {
        f64::from(coarse)
            + self.independent.uniform_f64() * SPACING[usize::from(self.is_independent)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::stats::chi_square;

    /// A smooth function of the first eight numbers of a path, with mean one.
    fn smooth(numbers: &mut impl Uniforms) -> f64 {
        let [a, b] = [numbers.four(), numbers.four()];
        (a.iter().chain(&b))
            .map(|&x| 1.0 + 0.3 * (f64::from(x) - 0.5))
            .product()
    }

    /// Squared error of the mean over 256 points, averaged over `runs` keys.
    fn squared_error<U: Uniforms>(runs: u64, numbers: impl Fn(u64, u64) -> U) -> f64 {
        let error = |run| {
            let sum: f64 = (0..256).map(|i| smooth(&mut numbers(run, i))).sum();
            (sum / 256.0 - 1.0).powi(2)
        };
        (0..runs).map(error).sum::<f64>() / runs as f64
    }

    #[test]
    fn means_over_a_sequence_have_far_less_variance_than_over_independent_numbers() {
        let sequence = squared_error(64, |run, i| SequencePoint::new(3, [run, 0, 0], i));
        let independent = squared_error(64, |run, i| Stream::new(3, run, 0, i));
        assert!(sequence < 0.05 * independent, "{sequence} {independent}");
    }

    /// Chi-square over 16 cells of each of the first 48 numbers, over keys with one point each; 48 critical values at
    /// significance 1e-4 together (1e-4/48 each, 15 degrees of freedom).
    #[test]
    fn each_point_alone_is_uniform_in_every_dimension() {
        let mut cells = vec![[0u32; 16]; 48];
        for key in 0..8_000 {
            let mut point = SequencePoint::new(5, [key, 1, 2], 3);
            for group in 0..12 {
                for (d, x) in point.four().into_iter().enumerate() {
                    cells[4 * group + d][(x * 16.0) as usize] += 1;
                }
            }
        }
        for (dimension, cells) in cells.iter().enumerate() {
            let chi2 = chi_square(cells);
            assert!(chi2 < 51.5, "{dimension}: {chi2}");
        }
    }

    #[test]
    fn keys_with_the_same_index_are_uncorrelated_and_runs_longer_than_a_sequence_do_not_repeat() {
        let value = |key: [u64; 3], index| SequencePoint::new(7, key, index).four()[0];
        let correlation = |a: &dyn Fn(u64) -> f32, b: &dyn Fn(u64) -> f32| {
            let n = 4096u64;
            let sum: f64 = (0..n)
                .map(|i| (f64::from(a(i)) - 0.5) * (f64::from(b(i)) - 0.5))
                .sum();
            sum / n as f64 * 12.0
        };
        // Sets A and B of one cluster. Five standard deviations of independent numbers.
        let sets = correlation(&|i| value([0, 9, 0], i), &|i| value([0, 9, 1], i));
        assert!(sets.abs() < 5.0 / 64.0, "{sets}");
        let laps = correlation(&|i| value([0, 9, 0], i), &|i| value([0, 9, 0], i + LENGTH));
        assert!(laps.abs() < 5.0 / 64.0, "{laps}");
    }

    /// Chi-square over 16 cells of what is added to 4,000 numbers in units of their spacing, the sequence's and later ones: two
    /// critical values at significance 1e-4 together (15 degrees of freedom).
    #[test]
    fn a_refined_number_keeps_its_leading_bits_and_fills_the_gap_to_the_next() {
        for (groups, spacing) in [(GROUPS, SPACING[0]), (GROUPS + 1, SPACING[1])] {
            let mut cells = [0u32; 16];
            for key in 0..4_000 {
                let mut point = SequencePoint::new(1, [key, 3, 4], 5);
                let coarse = (0..groups).map(|_| point.four()[0]).last().unwrap_or(0.0);
                let steps = f64::from(coarse) / spacing;
                assert_eq!(steps, steps.round(), "{groups}");
                let added = (point.refine(coarse) - f64::from(coarse)) / spacing;
                cells[(added * 16.0) as usize] += 1;
            }
            let chi2 = chi_square(&cells);
            assert!(chi2 < 46.2, "{groups}: {chi2}");
        }
    }
}
