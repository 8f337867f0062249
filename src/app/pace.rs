//! How often the window is painted for what the worker sends.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Time between two pictures where a graphics card draws.
const CARD: Duration = Duration::from_millis(16);
/// The same where the processor draws, while a person is active or nothing is solved.
const ACTIVE: Duration = Duration::from_millis(250);
/// How long a person counts as active after a key or a movement.
const ACTIVE_FOR: Duration = Duration::from_secs(3);
/// About the time that one core takes to draw a pixel of the window (Mesa's llvmpipe).
const PIXEL: Duration = Duration::from_nanos(150);
/// Greatest fraction of all cores that painting takes from a solve while nobody is active.
const FRACTION: f64 = 0.025;
/// Longest time between two pictures.
const LONGEST: Duration = Duration::from_secs(8);

/// What the time between two pictures depends on; shared with the worker's thread.
#[derive(Debug)]
pub struct Pace {
    software: bool,
    cores: usize,
    began: Instant,
    pixels: AtomicU64,
    /// Milliseconds after `began`.
    touched: AtomicU64,
    solving: AtomicBool,
}

impl Pace {
    /// The pace of a window that is drawn by the processor (`software`) or by a card.
    pub fn new(software: bool) -> Self {
        Self {
            software,
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            began: Instant::now(),
            pixels: AtomicU64::new(0),
            touched: AtomicU64::new(0),
            solving: AtomicBool::new(false),
        }
    }

    /// Takes note of a pass: the window's pixels, whether a person did something, whether the solver runs.
    pub fn note(&self, pixels: u64, touched: bool, solving: bool) {
        self.pixels.store(pixels, Ordering::Relaxed);
        self.solving.store(solving, Ordering::Relaxed);
        if touched {
            let now = self.began.elapsed().as_millis() as u64;
            self.touched.store(now, Ordering::Relaxed);
        }
    }

    /// Least time between two pictures now.
    pub fn interval(&self) -> Duration {
        let touched = Duration::from_millis(self.touched.load(Ordering::Relaxed));
        let idle = self.began.elapsed().saturating_sub(touched);
        if !self.software {
            CARD
        } else if idle < ACTIVE_FOR || !self.solving.load(Ordering::Relaxed) {
            ACTIVE
        } else {
            watching(self.pixels.load(Ordering::Relaxed), self.cores)
        }
    }
}

/// Time between two pictures of so many pixels, so that painting takes at most its fraction of the cores.
fn watching(pixels: u64, cores: usize) -> Duration {
    let paint = PIXEL.as_secs_f64() * pixels as f64;
    let wanted = Duration::from_secs_f64(paint / (FRACTION * cores.max(1) as f64));
    wanted.clamp(ACTIVE, LONGEST)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn painting_waits_for_a_solve_that_is_only_watched_and_never_for_a_person() {
        let pace = Pace::new(true);
        pace.note(1280 * 800, false, true);
        assert_eq!(pace.interval(), ACTIVE);
        let later = Pace {
            began: Instant::now()
                .checked_sub(ACTIVE_FOR * 2)
                .expect("the machine ran that long"),
            ..Pace::new(true)
        };
        later.note(1280 * 800, false, true);
        assert!(later.interval() > ACTIVE);
        later.note(1280 * 800, false, false);
        assert_eq!(later.interval(), ACTIVE);
        later.note(1280 * 800, true, true);
        assert_eq!(later.interval(), ACTIVE);
        assert_eq!(Pace::new(false).interval(), CARD);
    }

    #[test]
    fn more_pixels_take_longer_and_more_cores_less() {
        let small = watching(1_000_000, 2);
        assert!((small.as_secs_f64() - 3.0).abs() < 1e-9);
        assert!(watching(1_000_000, 8) < small && watching(2_000_000, 2) > small);
        assert_eq!(watching(u64::from(u32::MAX), 1), LONGEST);
        assert_eq!(watching(0, 0), ACTIVE);
    }
}
