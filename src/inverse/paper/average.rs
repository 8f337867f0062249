//! The average of a descent's iterates, in which the noise of single steps cancels.

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// The exponent η of polynomial-decay averaging: weights grow with the η-th power of the step. With 3, the mean age of what is
/// averaged is a fifth of all steps (1 / (η + 2)), and its variance 16 / 7 of that of an even mean ((η + 1)² / (2η + 1)).
const DECAY: f32 = 3.0;

/// Polynomial-decay average of each parameter (Shamir and Zhang 2013), by its own number of steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Average {
    values: Vec<Vec3>,
    steps: Vec<u32>,
}

impl Average {
    /// Before any step: the start itself.
    pub fn new(values: Vec<Vec3>) -> Self {
        Self {
            steps: vec![0; values.len()],
            values,
        }
    }

    /// Takes in the value of a parameter after a step.
    pub fn add(&mut self, index: usize, value: Vec3) {
        self.steps[index] = self.steps[index].saturating_add(1);
        let weight = (DECAY + 1.0) / (DECAY + self.steps[index] as f32);
        let average = &mut self.values[index];
        *average += (value - *average) * weight;
    }

    /// Forgets all steps: the next value of a parameter replaces its average.
    pub fn restart(&mut self) {
        self.steps.fill(0);
    }

    /// Sets a parameter whatever its steps were.
    pub fn set(&mut self, index: usize, value: Vec3) {
        self.values[index] = value;
    }

    pub fn values(&self) -> &[Vec3] {
        &self.values
    }

    /// Number of parameters; `None` if the lengths differ, as in a corrupt file.
    pub fn parameters(&self) -> Option<usize> {
        (self.values.len() == self.steps.len()).then_some(self.values.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rng::Stream;

    #[test]
    fn it_is_the_first_value_then_a_mean_of_the_late_ones() {
        let mut average = Average::new(vec![Vec3::ZERO; 2]);
        average.add(0, Vec3::ONE);
        assert_eq!(average.values(), [Vec3::ONE, Vec3::ZERO]);
        // A start that is far off for a tenth of the steps leaves no trace, and noise shrinks.
        let mut stream = Stream::new(1, 0, 0, 0);
        for step in 0..1000 {
            let start = if step < 100 { 10.0 } else { 0.0 };
            average.add(0, Vec3::splat(start + stream.uniform() - 0.5));
        }
        // The noise of one value is 0.29, that of the average 0.29 √(16 / 7 / 1000) = 0.014.
        assert!(average.values()[0].x.abs() < 0.05, "{average:?}");
        average.restart();
        average.add(0, Vec3::ONE);
        assert_eq!(average.values()[0], Vec3::ONE);
    }
}
