//! The solves to be measured: every preset, and variations of single settings.

use crate::inverse::settings::{PARAMETERS, Preset, Settings};

/// A solve to be measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Name of the preset, followed by what differs from it.
    pub name: String,
    /// Whether it is an unchanged preset.
    pub is_preset: bool,
    /// The parameters.
    pub settings: Settings,
    /// Weight of its time among all runs.
    pub weight: f64,
}

/// The presets with the weights of their times.
const PRESETS: [(Preset, f64); 4] = [
    (Preset::Preview, 3.0),
    (Preset::Balanced, 6.0),
    (Preset::Reference, 8.0),
    (Preset::Paper, 8.0),
];
/// Weight of the time of a variation.
const VARIED_WEIGHT: f64 = 2.0;

/// Variations: preset, setting, and values.
const VARIED: &[(Preset, &str, &[&str])] = &[
    (Preset::Preview, "paths", &["100000", "1600000"]),
    (Preset::Preview, "pixels", &["15000", "240000"]),
    (Preset::Balanced, "paths", &["400000", "6000000"]),
    (Preset::Balanced, "pixels", &["30000", "480000"]),
    (Preset::Balanced, "bounces", &["2", "4", "8"]),
    (Preset::Balanced, "light_sampling", &["emitter", "bsdf"]),
    (Preset::Paper, "bounces", &["8"]),
    (Preset::Paper, "learning_rate", &["0.02"]),
    (Preset::Paper, "samples", &["8"]),
    (Preset::Paper, "loss", &["l2"]),
    (Preset::Paper, "decay", &["0.1"]),
];

/// The presets, over the other parameters of `base`.
pub fn presets(base: &Settings) -> Vec<Run> {
    let run = |&(preset, weight): &(Preset, f64)| Run {
        name: preset.word().to_owned(),
        is_preset: true,
        settings: Settings {
            preset,
            ..base.clone()
        },
        weight,
    };
    PRESETS.iter().map(run).collect()
}

/// The presets, then all variations, over the other parameters of `base`.
pub fn everything(base: &Settings) -> Vec<Run> {
    let mut runs = presets(base);
    for &(preset, name, values) in VARIED {
        for text in values {
            let mut settings = Settings {
                preset,
                ..base.clone()
            };
            let parameter = PARAMETERS.iter().find(|p| p.name == name);
            let set = parameter.is_some_and(|parameter| {
                let value = parameter.parse(text);
                value.is_ok_and(|value| parameter.set(&mut settings, &value).is_ok())
            });
            debug_assert!(set, "{name} {text}");
            runs.push(Run {
                name: format!("{}, {} {text}", preset.word(), name.replace('_', " ")),
                is_preset: false,
                settings,
                weight: VARIED_WEIGHT,
            });
        }
    }
    runs
}

/// A preset and its variations, with equal times: for choosing the preset's settings.
pub fn around(word: &str, base: &Settings) -> Vec<Run> {
    let mut runs = everything(base);
    runs.retain(|run| run.settings.preset.word() == word);
    for run in &mut runs {
        run.weight = 1.0;
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_variation_differs_from_its_preset_in_one_parameter() {
        let base = Settings {
            seed: 9,
            ..Settings::default()
        };
        let runs = everything(&base);
        let names: std::collections::HashSet<&str> = runs.iter().map(|r| r.name.as_str()).collect();
        assert_eq!(names.len(), runs.len());
        for run in &runs {
            let preset = Settings {
                preset: run.settings.preset,
                ..base.clone()
            };
            let changed = PARAMETERS
                .iter()
                .filter(|p| p.get(&preset) != p.get(&run.settings))
                .count();
            assert_eq!(changed, usize::from(!run.is_preset), "{}", run.name);
        }
    }
    #[test]
    fn around_a_preset_are_it_and_its_variations_with_equal_fractions() {
        let base = Settings::default();
        let runs = around("preview", &base);
        assert!(runs[0].is_preset && runs.len() > 1);
        for run in &runs {
            assert_eq!((run.settings.preset, run.weight), (Preset::Preview, 1.0));
        }
        let all: usize = (Preset::WORDS.iter())
            .map(|word| around(word, &base).len())
            .sum();
        assert_eq!(all, everything(&base).len());
    }
}
