//! Cumulative sums of weights, for choices in proportion to them.

/// The running sums of weights.
#[derive(Debug, Clone, PartialEq)]
pub struct Cumulative(Vec<f64>);

impl Cumulative {
    /// The sums of weights, which are not negative.
    pub fn new(weights: impl IntoIterator<Item = f64>) -> Self {
        let sums = weights.into_iter().scan(0.0, |sum, weight| {
            *sum += weight;
            Some(*sum)
        });
        Self(sums.collect())
    }

    /// Each sum, up to and with the weight of its index.
    pub fn sums(&self) -> &[f64] {
        &self.0
    }

    /// Sum of all weights.
    pub fn total(&self) -> f64 {
        self.0.last().copied().unwrap_or(0.0)
    }

    /// Sum of the weights before an index.
    pub fn before(&self, index: usize) -> f64 {
        index.checked_sub(1).map_or(0.0, |last| self.0[last])
    }

    /// The index in whose weight a number from 0 to the total falls; `None` without weights.
    pub fn index_at(&self, number: f64) -> Option<usize> {
        let last = self.0.len().checked_sub(1)?;
        Some(self.0.partition_point(|&sum| sum <= number).min(last))
    }
}
