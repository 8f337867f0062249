//! When the descent measures its loss, and when the loss has converged. Intervals are numbers of paths instead of seconds, so
//! that a solve takes the same course on any machine.

use serde::{Deserialize, Serialize};

/// What tells that a loss has converged.
#[derive(Debug, Clone, Copy)]
pub struct Rule {
    /// Number of measurements in a window.
    pub window: usize,
    /// Least relative decrease between the means of two consecutive windows.
    pub decrease: f64,
}

/// The losses since the last change of the learning rate.
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

    pub fn traced(&mut self, paths: u64) {
        self.until_measured = self.until_measured.saturating_sub(paths);
    }

    /// Adds a loss; the next one is due after `next` paths. Returns whether the losses have converged by a rule.
    pub fn measured(&mut self, loss: Option<f64>, next: u64, rule: Rule) -> bool {
        let window = rule.window;
        self.until_measured = next;
        self.losses.extend(loss);
        if self.losses.len() < 2 * window {
            return false;
        }
        let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
        let (before, last) = self.losses[self.losses.len() - 2 * window..].split_at(window);
        mean(last) > mean(before) * (1.0 - rule.decrease)
    }

    /// Removes the losses of an earlier learning rate.
    pub fn start_over(&mut self) {
        self.losses.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_falling_loss_goes_on_and_a_level_one_stands_still_after_two_windows() {
        let rule = Rule {
            window: 4,
            decrease: 0.01,
        };
        let mut falling = Schedule::default();
        assert!((0..20).all(|i| !falling.measured(Some(0.9f64.powi(i)), 1, rule)));
        let mut level = Schedule::default();
        assert!((0..7).all(|_| !level.measured(Some(1.0), 1, rule)));
        assert!(level.measured(Some(1.0), 1, rule));
        level.start_over();
        assert!(!level.measured(Some(1.0), 1, rule));
    }
}
