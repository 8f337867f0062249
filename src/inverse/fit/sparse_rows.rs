//! Sparse rows of three channels, one after another in memory.

use glam::DVec3;

/// Rows whose entries have increasing parameters.
#[derive(Debug, Clone, Default)]
pub struct SparseRows {
    /// End of each row.
    ends: Vec<usize>,
    /// Parameter and value.
    entries: Vec<(u32, DVec3)>,
}

impl SparseRows {
    /// Appends a row.
    pub fn push(&mut self, row: impl Iterator<Item = (u32, DVec3)>) {
        self.entries.extend(row);
        self.ends.push(self.entries.len());
    }

    /// All rows.
    pub fn iter(&self) -> impl Iterator<Item = &[(u32, DVec3)]> {
        let starts = std::iter::once(&0).chain(&self.ends);
        (starts.zip(&self.ends)).map(|(&start, &end)| &self.entries[start..end])
    }

    /// Divides each row by the next of `divisors`.
    pub fn divide<'a>(&mut self, divisors: &mut impl Iterator<Item = &'a DVec3>) {
        let mut start = 0;
        for (&end, divisor) in self.ends.iter().zip(divisors.by_ref()) {
            for (_, value) in &mut self.entries[start..end] {
                *value /= *divisor;
            }
            start = end;
        }
    }
}
