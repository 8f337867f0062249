//! Which pixels are held out of every fit, to test it.

use crate::error::{Error, Result};
use crate::math::rng::splitmix64;
use serde::{Deserialize, Serialize};

/// Settings of the held-out pixels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct HoldOut {
    /// Fraction of the pixels that is held out, if `hold_out` is 0.
    pub held_out: f64,
    /// If K > 0, every K-th frame is held out whole instead of single pixels.
    pub hold_out: u64,
}

impl Default for HoldOut {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl HoldOut {
    /// 5 % of single pixels.
    pub const DEFAULT: Self = Self {
        held_out: 0.05,
        hold_out: 0,
    };

    /// Whether a pixel is held out: by a hash of frame and pixel, or every K-th frame (frames 0, K, 2K, …).
    ///
    /// The choice does not depend on the seed of a solve: solves with different seeds are tested on the same pixels.
    pub fn contains(self, frame: u32, pixel: u32) -> bool {
        if self.hold_out > 0 {
            return u64::from(frame).is_multiple_of(self.hold_out);
        }
        let hash = splitmix64(splitmix64(u64::from(frame)) ^ u64::from(pixel));
        ((hash >> 11) as f64) < self.held_out * (1u64 << 53) as f64
    }

    /// Checks that some of `frames` photographs are left to fit.
    ///
    /// # Errors
    /// All photographs would be held out.
    pub fn check(self, frames: usize) -> Result<()> {
        if self.hold_out == 0 || frames == 0 || frames > 1 && self.hold_out > 1 {
            return Ok(());
        }
        Err(Error::usage(
            "hold_out",
            match frames {
                1 => "the only photograph would be held out, which leaves none to fit".to_owned(),
                _ => {
                    format!("all {frames} photographs would be held out, which leaves none to fit")
                }
            },
            "with two photographs or more, hold out every second one or fewer; 0 holds out none",
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fraction_is_as_asked_and_frames_can_be_held_out_whole() {
        let mut hold_out = HoldOut::default();
        let count = |hold_out: HoldOut| (0..100_000).filter(|&p| hold_out.contains(3, p)).count();
        // Binomial with standard deviation 69: five of them.
        assert!((count(hold_out) as i64 - 5_000).abs() < 345);
        hold_out.held_out = 0.0;
        assert_eq!(count(hold_out), 0);
        hold_out.hold_out = 4;
        let held: Vec<u32> = (0..10).filter(|&f| hold_out.contains(f, 17)).collect();
        assert_eq!(held, [0, 4, 8]);
        assert!(hold_out.check(2).is_ok());
        assert!(hold_out.check(1).is_err());
        hold_out.hold_out = 1;
        assert!(hold_out.check(9).is_err());
        hold_out.hold_out = 0;
        assert!(hold_out.check(1).is_ok());
    }
}
