//! How much work a dispatch gets: drivers kill one that runs for seconds, and a card shared with a screen must come back sooner.

use crate::gpu::layout::WORKGROUP;
use std::time::Duration;

/// Seconds that a dispatch should take.
const TARGET: f64 = 0.02;
/// Paths of the first dispatch; on the slowest adapters they take a fraction of a second.
const START: u32 = 1 << 12;
/// Most paths of a dispatch: as many as one dimension of workgroups holds.
const MAX: u32 = 65_535 * WORKGROUP;
/// Most samples a pixel in one dispatch.
const MAX_SAMPLES: u32 = 64;

/// Paths of the next dispatch, from how long earlier ones took.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pace {
    paths: u32,
}

impl Default for Pace {
    fn default() -> Self {
        Self { paths: START }
    }
}

impl Pace {
    /// Pixels and samples of the next dispatch, of those that are left.
    pub fn slice(&self, pixels: u32, samples: u32) -> [u32; 2] {
        if self.paths < pixels {
            return [self.paths, 1];
        }
        let fit = (self.paths / pixels.max(1)).clamp(1, MAX_SAMPLES);
        [pixels, fit.min(samples)]
    }

    /// Hears how long a dispatch of some paths took.
    pub fn took(&mut self, paths: u32, time: Duration) {
        // A small rest of work says little about a full dispatch.
        if paths < self.paths / 2 {
            return;
        }
        let factor = (TARGET / time.as_secs_f64().max(1e-6)).clamp(0.25, 4.0);
        let wanted = (f64::from(paths) * factor) as u32;
        self.paths = wanted.clamp(WORKGROUP, MAX) / WORKGROUP * WORKGROUP;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_adapters_get_less_fast_ones_more_and_rests_change_nothing() {
        let mut pace = Pace::default();
        assert_eq!(pace.slice(100_000, 8), [4096, 1]);
        pace.took(4096, Duration::from_secs(2));
        assert_eq!(pace.slice(100_000, 8), [1024, 1]);
        pace.took(64, Duration::from_micros(1));
        assert_eq!(pace.slice(100_000, 8), [1024, 1]);
        for _ in 0..20 {
            pace.took(pace.paths, Duration::from_micros(10));
        }
        assert_eq!(pace.slice(100_000, 8), [100_000, 8]);
        assert_eq!(pace.slice(100_000, 1000), [100_000, 41]);
        pace.took(pace.paths, Duration::from_secs(3600));
        assert!(pace.paths >= WORKGROUP && pace.paths.is_multiple_of(WORKGROUP));
    }
}
