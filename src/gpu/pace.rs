//! The amount of work per dispatch: drivers kill dispatches of seconds, and a card that drives a screen must respond sooner.

use crate::gpu::layout::WORKGROUP;
use std::time::Duration;

/// Target duration of a dispatch in seconds.
const TARGET_SECONDS: f64 = 0.02;
/// Paths of the first dispatch: a fraction of a second on the slowest adapters.
const START: u32 = 1 << 12;
/// Maximum number of paths per dispatch: the limit on workgroups in one dimension.
const MAX_PATHS: u32 = 65_535 * WORKGROUP;
/// Maximum number of samples per pixel in one dispatch.
const MAX_SAMPLES: u32 = 64;

/// The number of paths of the next dispatch, adapted to the duration of earlier ones.
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
    /// Numbers of pixels and samples of the next dispatch, out of those left.
    pub fn slice(&self, pixels: u32, samples: u32) -> [u32; 2] {
        if self.paths < pixels {
            return [self.paths, 1];
        }
        let fit = (self.paths / pixels.max(1)).clamp(1, MAX_SAMPLES);
        [pixels, fit.min(samples)]
    }

    /// Adapts to the duration of a dispatch of `paths` paths.
    pub fn record(&mut self, paths: u32, time: Duration) {
        // Small dispatches are not representative, unless they are slow.
        if paths < self.paths / 2 && time.as_secs_f64() < TARGET_SECONDS {
            return;
        }
        let factor = (TARGET_SECONDS / time.as_secs_f64().max(1e-6)).clamp(0.25, 4.0);
        let wanted = (f64::from(paths) * factor) as u32;
        self.paths = wanted.clamp(WORKGROUP, MAX_PATHS) / WORKGROUP * WORKGROUP;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_adapters_get_less_fast_ones_more_and_rests_change_nothing() {
        let mut pace = Pace::default();
        assert_eq!(pace.slice(100_000, 8), [4096, 1]);
        pace.record(4096, Duration::from_secs(2));
        assert_eq!(pace.slice(100_000, 8), [1024, 1]);
        pace.record(64, Duration::from_micros(1));
        assert_eq!(pace.slice(100_000, 8), [1024, 1]);
        for _ in 0..20 {
            pace.record(pace.paths, Duration::from_micros(10));
        }
        assert_eq!(pace.slice(100_000, 8), [100_000, 8]);
        assert_eq!(pace.slice(100_000, 1000), [100_000, 41]);
        pace.record(pace.paths, Duration::from_secs(3600));
        assert!(pace.paths >= WORKGROUP && pace.paths.is_multiple_of(WORKGROUP));
    }
}
