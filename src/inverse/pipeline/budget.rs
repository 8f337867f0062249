//! The amount of work of each preset, and the error at which it stops.

use crate::inverse::settings::{Preset, Settings};

/// The part of path noise in an error where accuracy is asked for: without it the error would be 6 % less, with a half 13 %.
pub const ACCURATE: f64 = 1.0 / 3.0;

/// Paths of `preview`'s light field.
const PREVIEW_PATHS: u64 = 400_000;
/// Full paths of `preview`, which it traces where lamps are out of sight. With 400,000 the median error in `relit trade --rooms 6
/// --family unseen --preset preview` is 0.078, with this number 0.060.
const PREVIEW_SEARCH: u64 = 1_000_000;

/// Work and targets of a solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Budget {
    /// Pixels of the g-buffer.
    pub gbuffer_pixels: usize,
    /// Pixels of the fit.
    pub pixels: usize,
    /// Paths of the first stage, which end in measured radiance.
    pub light_field_paths: u64,
    /// Greatest number of paths of a trial of outside light: `preview`'s number in all presets, which the benchmarks of scanned rooms
    /// measure.
    pub trial_paths: u64,
    /// Full paths of each round.
    pub round_paths: u64,
    /// Greatest number of rounds. Zero ends the solve after the first stage, or after the second one where lamps are out of sight.
    pub rounds: u32,
    /// Greatest number of rounds before textures are fitted.
    pub texture_rounds: u32,
    /// Target errors.
    pub aim: Aim,
}

/// Target relative standard errors of the albedos of seen objects.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// Median over objects.
    pub median: f64,
    /// 95th percentile over objects.
    pub tail: f64,
    /// Fraction of these below which the part due to path noise is negligible.
    pub path_noise: f64,
}

impl Budget {
    /// The budget of the preset, with the values that the settings override; related values scale in proportion.
    pub fn of(settings: &Settings) -> Self {
        let mut budget = Self::of_preset(settings.preset);
        if settings.pixels > 0 {
            let fraction = settings.pixels as f64 / budget.pixels as f64;
            budget.pixels = usize::try_from(settings.pixels).unwrap_or(usize::MAX);
            budget.gbuffer_pixels = (budget.gbuffer_pixels as f64 * fraction).ceil() as usize;
        }
        if settings.paths > 0 {
            let [first, second] = [&mut budget.light_field_paths, &mut budget.round_paths];
            let (given, other) = match budget.rounds {
                0 => (first, second),
                _ => (second, first),
            };
            *other = (*other as f64 * settings.paths as f64 / *given as f64).ceil() as u64;
            *given = settings.paths;
        }
        budget.trial_paths = budget.trial_paths.min(budget.light_field_paths);
        budget
    }

    /// The budget of a preset.
    const fn of_preset(preset: Preset) -> Self {
        match preset {
            Preset::Preview => Self {
                gbuffer_pixels: 100_000,
                pixels: 60_000,
                light_field_paths: PREVIEW_PATHS,
                trial_paths: PREVIEW_PATHS,
                round_paths: PREVIEW_SEARCH,
                rounds: 0,
                texture_rounds: 0,
                aim: Aim {
                    median: 0.02,
                    tail: 0.2,
                    path_noise: 0.5,
                },
            },
            Preset::Balanced | Preset::Paper => Self {
                gbuffer_pixels: 400_000,
                pixels: 120_000,
                light_field_paths: 1_000_000,
                trial_paths: PREVIEW_PATHS,
                round_paths: 1_500_000,
                rounds: 16,
                texture_rounds: 16,
                aim: Aim {
                    median: 5e-3,
                    tail: 0.05,
                    path_noise: 0.5,
                },
            },
            Preset::Reference => Self {
                gbuffer_pixels: 1_500_000,
                pixels: 400_000,
                light_field_paths: 2_000_000,
                trial_paths: PREVIEW_PATHS,
                round_paths: 3_000_000,
                rounds: 100,
                texture_rounds: 8,
                aim: Aim {
                    median: 4e-4,
                    tail: 0.01,
                    path_noise: ACCURATE,
                },
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_overrule_presets_in_proportion() {
        let of = |preset, pixels, paths| {
            Budget::of(&Settings {
                preset,
                pixels,
                paths,
                ..Settings::default()
            })
        };
        let plain = of(Preset::Balanced, 0, 0);
        let more = of(
            Preset::Balanced,
            plain.pixels as u64 * 2,
            plain.round_paths * 3,
        );
        assert_eq!(more.gbuffer_pixels, plain.gbuffer_pixels * 2);
        assert_eq!(more.round_paths, plain.round_paths * 3);
        assert_eq!(more.light_field_paths, plain.light_field_paths * 3);
        // Without rounds the number is that of the light field.
        let preview = of(Preset::Preview, 0, 4_000);
        assert_eq!(
            (preview.light_field_paths, preview.round_paths),
            (4_000, 10_000)
        );
        assert_eq!(preview.rounds, 0);
    }
}
