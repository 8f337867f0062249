//! When the descent measures its loss, and when the loss stands still. Both count work, not seconds, so that a solve
//! takes the same course on any machine.

use serde::{Deserialize, Serialize};

/// Paths between two measurements: some forty times as many as a measurement takes.
const MEASURE_EVERY: u64 = 500_000;
/// The loss stands still when the mean of this many measurements is no better than that of as many before, by a share.
const WINDOW: usize = 4;
const STANDSTILL: f64 = 0.01;

/// Losses since the last change of the learning rate, and the work until the next.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Schedule {
    losses: Vec<f64>,
    until_measured: u64,
}

impl Schedule {
    /// Whether the loss is to be measured now.
    pub fn due(&self) -> bool {
        self.until_measured == 0
    }

    /// Takes note of paths traced.
    pub fn traced(&mut self, paths: u64) {
        self.until_measured = self.until_measured.saturating_sub(paths);
    }

    /// Takes note of a loss; whether it stands still.
    pub fn measured(&mut self, loss: Option<f64>) -> bool {
        self.until_measured = MEASURE_EVERY;
        self.losses.extend(loss);
        if self.losses.len() < 2 * WINDOW {
            return false;
        }
        let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
        let (before, last) = self.losses[self.losses.len() - 2 * WINDOW..].split_at(WINDOW);
        mean(last) > mean(before) * (1.0 - STANDSTILL)
    }

    /// Forgets the losses of an earlier learning rate.
    pub fn start_over(&mut self) {
        self.losses.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_falling_loss_goes_on_and_a_level_one_stands_still_after_two_windows() {
        let mut falling = Schedule::default();
        assert!((0..20).all(|i| !falling.measured(Some(0.9f64.powi(i)))));
        let mut level = Schedule::default();
        let still: Vec<bool> = (0..8).map(|_| level.measured(Some(1.0))).collect();
        assert_eq!(
            still,
            [false, false, false, false, false, false, false, true]
        );
        level.start_over();
        assert!(!level.measured(Some(1.0)));
    }

    #[test]
    fn a_measurement_is_due_at_first_and_after_enough_paths() {
        let mut schedule = Schedule::default();
        assert!(schedule.due());
        schedule.measured(None);
        schedule.traced(MEASURE_EVERY - 1);
        assert!(!schedule.due());
        schedule.traced(16);
        assert!(schedule.due());
    }
}
