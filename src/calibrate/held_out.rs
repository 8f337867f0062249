//! Which pixels are kept out of every fit, to test it.

use crate::error::{Error, Result};
use crate::math::rng::splitmix64;
use serde::{Deserialize, Serialize};

/// What is kept out of every fit, as the solve's settings say it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct HoldOut {
    /// Fraction of the pixels.
    pub held_out: f64,
    /// Every so many frames, instead of single pixels; 0 keeps single pixels.
    pub hold_out: u64,
}

impl Default for HoldOut {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl HoldOut {
    /// What is held out where nothing else is asked for.
    pub const DEFAULT: Self = Self {
        held_out: 0.05,
        hold_out: 0,
    };

    /// Whether a pixel is held out: a keyed fraction of all pixels, or every K-th frame whole (frames 0, K, 2K, …).
    ///
    /// The choice does not depend on the seed, so that solves with different seeds are tested on the same pixels.
    pub fn contains(self, frame: u32, pixel: u32) -> bool {
        if self.hold_out > 0 {
            return u64::from(frame).is_multiple_of(self.hold_out);
        }
        let hash = splitmix64(splitmix64(u64::from(frame)) ^ u64::from(pixel));
        ((hash >> 11) as f64) < self.held_out * (1u64 << 53) as f64
    }

    /// Refuses to hold out all of `frames` photographs.
    ///
    /// # Errors
    /// No photograph is left to fit.
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
            "hold out every second at most, of two or more, or none with 0",
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
