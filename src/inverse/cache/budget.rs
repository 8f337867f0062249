//! How much work each preset does, and what error it stops at.

use crate::inverse::settings::Preset;

/// Work and targets of a solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Budget {
    /// Pixels looked at to find what they see.
    pub survey_pixels: usize,
    /// Pixels fitted.
    pub pixels: usize,
    /// Paths of the first stage, which end in measured radiance.
    pub light_field_paths: u64,
    /// Paths of each round that goes all the way to the lamps; zero leaves the refinement out.
    pub round_paths: u64,
    /// Rounds at most.
    pub rounds: u32,
    /// Stops when the median relative standard error of the seen albedos is below this.
    pub median_error: f64,
    /// And when 95 % of them are below this.
    pub tail_error: f64,
}

impl Budget {
    /// The budget of a preset.
    pub const fn of(preset: Preset) -> Self {
        match preset {
            Preset::Preview => Self {
                survey_pixels: 100_000,
                pixels: 60_000,
                light_field_paths: 400_000,
                round_paths: 0,
                rounds: 0,
                median_error: 0.02,
                tail_error: 0.2,
            },
            Preset::Balanced | Preset::Paper => Self {
                survey_pixels: 400_000,
                pixels: 120_000,
                light_field_paths: 1_000_000,
                round_paths: 1_500_000,
                rounds: 16,
                median_error: 5e-3,
                tail_error: 0.05,
            },
            Preset::Reference => Self {
                survey_pixels: 1_500_000,
                pixels: 400_000,
                light_field_paths: 2_000_000,
                round_paths: 3_000_000,
                rounds: 100,
                median_error: 4e-4,
                tail_error: 0.01,
            },
        }
    }
}
