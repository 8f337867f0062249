//! Cumulative sums of weights, for choices in proportion to them.

/// The running sums of weights, with a guide to them, so that a choice takes constant time on average (the "method of guide
/// tables" of Chen and Asau 1974).
#[derive(Debug, Clone, PartialEq)]
pub struct Cumulative {
    sums: Vec<f64>,
    /// For each of as many equal parts of the total as there are weights, the first index whose sum lies in it or beyond.
    guide: Vec<u32>,
}

impl Cumulative {
    /// The sums of weights, which are not negative.
    pub fn new(weights: impl IntoIterator<Item = f64>) -> Self {
        let sums = weights.into_iter().scan(0.0, |sum, weight| {
            *sum += weight;
            Some(*sum)
        });
        let mut this = Self {
            sums: sums.collect(),
            guide: Vec::new(),
        };
        let mut guide = Vec::with_capacity(this.sums.len());
        for (index, &sum) in (0..).zip(&this.sums) {
            let next = this.part(sum) + 1;
            guide.resize(next.max(guide.len()), index);
        }
        this.guide = guide;
        this
    }

    /// Each sum, up to and with the weight of its index.
    pub fn sums(&self) -> &[f64] {
        &self.sums
    }

    /// Sum of all weights.
    pub fn total(&self) -> f64 {
        self.sums.last().copied().unwrap_or(0.0)
    }

    /// Sum of the weights before an index.
    pub fn before(&self, index: usize) -> f64 {
        index.checked_sub(1).map_or(0.0, |last| self.sums[last])
    }

    /// The index in whose weight a number from 0 to the total falls; `None` without weights.
    pub fn index_at(&self, number: f64) -> Option<usize> {
        let last = self.sums.len().checked_sub(1)?;
        // Rounding cannot lead past the answer: a smaller number never lies in a later part.
        let part = self.part(number);
        let at = |part: usize| self.guide.get(part).map_or(last, |&index| index as usize);
        let (start, end) = (at(part), at(part + 1));
        let beyond = self.sums[start..end].partition_point(|&sum| sum <= number);
        Some((start + beyond).min(last))
    }

    /// The part of the total that a number lies in.
    fn part(&self, number: f64) -> usize {
        let parts = self.sums.len();
        let part = (number / self.total() * parts as f64) as usize;
        part.min(parts.saturating_sub(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;

    /// Weights of all sizes, zeros among them, and numbers on and beside each sum.
    #[test]
    fn the_guide_leads_to_what_a_search_through_all_sums_finds() {
        let mut stream = Stream::new(5, 0, 0, 0);
        for count in [1, 2, 3, 50, 1000] {
            for scale in [0, 40] {
                let mut weight = || match stream.uniform() {
                    u if u < 0.3 => 0.0,
                    u => f64::from(u).powi(scale),
                };
                let cumulative = Cumulative::new((0..count).map(|_| weight()));
                let sums = cumulative.sums().to_vec();
                let numbers = (sums.iter())
                    .flat_map(|&sum| [sum.next_down(), sum, sum.next_up()])
                    .chain([0.0, cumulative.total()]);
                for number in numbers {
                    let searched = sums.partition_point(|&sum| sum <= number);
                    let found = cumulative.index_at(number);
                    assert_eq!(found, Some(searched.min(count - 1)), "{number} of {sums:?}");
                }
            }
        }
        assert_eq!(Cumulative::new([]).index_at(0.0), None);
        assert_eq!(Cumulative::new([0.0, 0.0]).index_at(0.0), Some(1));
    }
}
