//! Sparse ADAM (Kingma and Ba 2015): each parameter has its own step count, which increases only when a path meets it.

use glam::Vec3;
use serde::{Deserialize, Serialize};

const BETA1: f32 = 0.9;
const BETA2: f32 = 0.999;
const EPSILON: f32 = 1e-8;

/// First and second moments of each parameter's RGB gradient, and its number of steps.
///
/// A parameter's moments decay, and are bias-corrected, by its own step count. With a common count, moments of parameters that
/// batches rarely meet would decay between their steps without a matching correction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Adam {
    first: Vec<Vec3>,
    second: Vec<Vec3>,
    steps: Vec<u32>,
}

impl Adam {
    /// For `parameters` parameters.
    pub fn new(parameters: usize) -> Self {
        Self {
            first: vec![Vec3::ZERO; parameters],
            second: vec![Vec3::ZERO; parameters],
            steps: vec![0; parameters],
        }
    }

    /// Number of parameters; `None` if the lengths differ, as in a corrupt file.
    pub fn parameters(&self) -> Option<usize> {
        let count = self.first.len();
        (self.second.len() == count && self.steps.len() == count).then_some(count)
    }

    /// Number of gradients of a parameter.
    pub fn steps(&self, index: usize) -> u32 {
        self.steps[index]
    }

    /// The change of one parameter, given its gradient.
    pub fn step(&mut self, index: usize, gradient: Vec3, learning_rate: f32) -> Vec3 {
        self.steps[index] = self.steps[index].saturating_add(1);
        let steps = self.steps[index].min(1 << 30) as i32;
        let (m, v) = (&mut self.first[index], &mut self.second[index]);
        *m = *m * BETA1 + gradient * (1.0 - BETA1);
        *v = *v * BETA2 + gradient * gradient * (1.0 - BETA2);
        let correct = |beta: f32| 1.0 - f64::from(beta).powi(steps) as f32;
        let (m, v) = (*m / correct(BETA1), *v / correct(BETA2));
        -learning_rate * m / (v.powf(0.5) + EPSILON)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The second step for gradients 1 then 0.5, worked out by hand from the published update.
    #[test]
    fn later_steps_follow_the_published_update() {
        let mut adam = Adam::new(1);
        adam.step(0, Vec3::ONE, 1.0);
        let step = adam.step(0, Vec3::splat(0.5), 1.0);
        let m = (0.9 * 0.1 + 0.1 * 0.5) / (1.0 - 0.81);
        let v: f32 = (0.999 * 0.001 + 0.001 * 0.25) / (1.0 - 0.998_001);
        assert!((step.x + m / v.sqrt()).abs() < 1e-4, "{step} {m} {v}");
    }

    /// A parameter that is stepped once in a thousand steps of another one behaves as if it were alone.
    #[test]
    fn what_is_met_rarely_is_stepped_as_if_it_were_alone() {
        let (mut shared, mut alone) = (Adam::new(2), Adam::new(1));
        for round in 0..5 {
            for _ in 0..1000 {
                shared.step(0, Vec3::ONE, 0.1);
            }
            let gradient = Vec3::splat(0.5 + round as f32);
            assert_eq!(shared.step(1, gradient, 0.1), alone.step(0, gradient, 0.1));
        }
    }
}
