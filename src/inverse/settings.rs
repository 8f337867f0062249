//! The table of parameters. Each is declared once and available on the command line, in the window, in presets and in files.

use crate::calibrate::held_out::HoldOut;
use serde::{Deserialize, Serialize};

/// The value of a parameter, for tables and text.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Value {
    /// On or off.
    Flag(bool),
    /// A whole number.
    Whole(u64),
    /// A real number.
    Real(f64),
    /// One of the parameter's choices.
    Choice(String),
}

/// The type and range of a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// On or off.
    Flag,
    /// Whole numbers in a closed range.
    Whole {
        /// Smallest.
        min: u64,
        /// Largest.
        max: u64,
    },
    /// Real numbers in a closed range.
    Real {
        /// Smallest.
        min: f64,
        /// Largest.
        max: f64,
        /// Whether a slider should be logarithmic.
        logarithmic: bool,
    },
    /// One of these words.
    Choice(&'static [&'static str]),
}

/// One row of the table.
#[derive(Debug, Clone, Copy)]
pub struct Parameter {
    /// Name in files and, with dashes, on the command line.
    pub name: &'static str,
    /// Kind and range.
    pub kind: Kind,
    /// Unit, or empty.
    pub unit: &'static str,
    /// One sentence of help.
    pub help: &'static str,
    /// Whether a change takes effect while a solver runs; otherwise at the next start.
    pub live: bool,
    get: fn(&Settings) -> Value,
    set: fn(&mut Settings, &Value) -> bool,
}

/// Rust types that a parameter may have.
trait ParameterType: Sized {
    fn to_value(&self) -> Value;
    fn from_value(value: &Value) -> Option<Self>;
}

impl ParameterType for bool {
    fn to_value(&self) -> Value {
        Value::Flag(*self)
    }
    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::Flag(flag) => Some(*flag),
            _ => None,
        }
    }
}

impl ParameterType for u64 {
    fn to_value(&self) -> Value {
        Value::Whole(*self)
    }
    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::Whole(n) => Some(*n),
            Value::Real(x) if x.fract() == 0.0 && *x >= 0.0 => Some(*x as u64),
            _ => None,
        }
    }
}

impl ParameterType for f64 {
    fn to_value(&self) -> Value {
        Value::Real(*self)
    }
    fn from_value(value: &Value) -> Option<Self> {
        match value {
            Value::Real(x) => Some(*x),
            Value::Whole(n) => Some(*n as f64),
            _ => None,
        }
    }
}

/// Declares an enum whose variants are the words of a choice parameter.
macro_rules! choice {
    ($(#[$doc:meta])* $name:ident { $($(#[$variant_doc:meta])* $variant:ident = $word:literal),* $(,)? }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
        pub enum $name {
            $($(#[$variant_doc])* #[serde(rename = $word)] $variant),*
        }
        impl $name {
            /// The words, in order.
            pub const WORDS: &'static [&'static str] = &[$($word),*];
            /// The choices, in order.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];
            /// The word of this choice.
            pub fn word(self) -> &'static str {
                match self { $(Self::$variant => $word),* }
            }
        }
        impl ParameterType for $name {
            fn to_value(&self) -> Value {
                Value::Choice(self.word().to_owned())
            }
            fn from_value(value: &Value) -> Option<Self> {
                match value {
                    Value::Choice(word) => match word.as_str() { $($word => Some(Self::$variant),)* _ => None },
                    _ => None,
                }
            }
        }
    };
}

choice! {
    /// Which solver runs, and how far.
    Preset {
        /// A usable answer within seconds; within a minute where lamps are out of sight.
        Preview = "preview",
        /// The default: a good answer in seconds.
        Balanced = "balanced",
        /// As exact as the photographs allow.
        Reference = "reference",
        /// The stochastic gradient descent of the paper.
        Paper = "paper",
    }
}

choice! {
    /// The data term of the paper solver.
    Loss {
        /// Absolute difference.
        L1 = "l1",
        /// Squared difference.
        L2 = "l2",
    }
}

choice! {
    /// Sampling strategy of direct light.
    LightSampling {
        /// Both, combined by the power heuristic.
        Mis = "mis",
        /// Next-event estimation alone.
        Emitter = "emitter",
        /// BSDF sampling alone.
        Bsdf = "bsdf",
    }
}

/// Declares [`Settings`] and its table.
macro_rules! parameters {
    ($($name:ident : $type:ty = $default:expr, $kind:expr, $unit:literal, $live:literal, $help:literal;)*) => {
        /// All parameters of a solve.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct Settings {
            $(#[doc = $help] pub $name: $type,)*
        }

        impl Default for Settings {
            fn default() -> Self {
                Self { $($name: $default,)* }
            }
        }

        /// The table, in the order in which it is shown.
        pub const PARAMETERS: &[Parameter] = &[$(Parameter {
            name: stringify!($name),
            kind: $kind,
            unit: $unit,
            help: $help,
            live: $live,
            get: |settings| settings.$name.to_value(),
            set: |settings, value| match <$type>::from_value(value) {
                Some(value) => { settings.$name = value; true }
                None => false,
            },
        },)*];
    };
}

parameters! {
    preset: Preset = Preset::Balanced, Kind::Choice(Preset::WORDS), "", false,
        "Which solver runs, and how far it goes";
    seed: u64 = 1, Kind::Whole { min: 0, max: u64::MAX }, "", false,
        "Seed of all random numbers: the same seed gives the same result";
    time: f64 = 0.0, Kind::Real { min: 0.0, max: 1e9, logarithmic: true }, "s", true,
        "Wall time after which the solve stops; 0 sets no limit";
    target_error: f64 = 0.0, Kind::Real { min: 0.0, max: 100.0, logarithmic: true }, "%", true,
        "Continue until the median relative standard error of the seen albedos is below this; 0 uses the preset's target";
    bounces: u64 = 0, Kind::Whole { min: 0, max: 1000 }, "", false,
        "Greatest number of bounces; 0 means 2 for the paper solver, and Russian roulette alone for the others";
    held_out: f64 = HoldOut::DEFAULT.held_out, Kind::Real { min: 0.0, max: 0.9, logarithmic: false }, "of the pixels", false,
        "Fraction of the pixels held out of the fit, to test it";
    hold_out: u64 = HoldOut::DEFAULT.hold_out, Kind::Whole { min: 0, max: 1_000_000 }, "frames", false,
        "Hold every K-th frame out of the fit instead of single pixels; 0 holds out single pixels";
    outside_light: bool = true, Kind::Flag, "", false,
        "Try light from outside the mesh, where rays leave it";
    exposures: bool = true, Kind::Flag, "", false,
        "Estimate the exposure and white balance of each photograph, vignetting and camera response, if photographs disagree on shared surfaces";
    leave_out: bool = true, Kind::Flag, "", false,
        "Leave out photographs that contradict the others on shared surfaces, for example because of a wrong pose (not in the paper solver)";
    lobes: bool = true, Kind::Flag, "", false,
        "Try a rough specular lobe on objects that look different in different views";
    textures: bool = true, Kind::Flag, "", false,
        "Try albedo that varies over an object, where its pixels show more than one colour";
    pixels: u64 = 0, Kind::Whole { min: 0, max: 1_000_000_000 }, "", false,
        "Approximate number of pixels in the fit of the transport cache; 0 uses the preset's number";
    paths: u64 = 0, Kind::Whole { min: 0, max: 1_000_000_000_000 }, "a round", false,
        "Paths of the transport cache in each round; the first stage scales in proportion; 0 uses the preset's number";
    memory: f64 = 0.0, Kind::Real { min: 0.0, max: 1e6, logarithmic: true }, "GiB", false,
        "Memory limit of stored paths; 0 uses a quarter of the machine's memory";
    learning_rate: f64 = 5e-3, Kind::Real { min: 1e-6, max: 10.0, logarithmic: true }, "", true,
        "Paper solver: initial step size of ADAM";
    batch: u64 = 8, Kind::Whole { min: 1, max: 1_000_000 }, "pixels", true,
        "Paper solver: initial number of pixels per step";
    samples: u64 = 1, Kind::Whole { min: 1, max: 65536 }, "a pixel", true,
        "Paper solver: paths for each pixel's colour, and as many for its derivative";
    loss: Loss = Loss::L1, Kind::Choice(Loss::WORDS), "", true,
        "Paper solver: absolute or squared difference to the photographs";
    emission_weight: f64 = 1e-3, Kind::Real { min: 0.0, max: 1.0, logarithmic: true }, "", true,
        "Paper solver: weight of the L1 regulariser on all emission";
    light_sampling: LightSampling = LightSampling::Mis, Kind::Choice(LightSampling::WORDS), "", true,
        "Sampling of direct light";
    decay: f64 = 0.0, Kind::Real { min: 0.0, max: 1.0, logarithmic: false }, "a 1000 steps", true,
        "Paper solver: fraction by which the learning rate falls every thousand steps";
    anneal: bool = true, Kind::Flag, "", true,
        "Paper solver: halve the learning rate and double the samples, at first the batch too, whenever the loss stands still";
    steps: u64 = 0, Kind::Whole { min: 0, max: 1_000_000_000 }, "", true,
        "Paper solver: stop after this many steps; 0 continues until the time limit or convergence";
}

/// Bounces of the paper's solver if none are set.
const PAPER_BOUNCES: u32 = 2;

impl From<&Settings> for HoldOut {
    fn from(settings: &Settings) -> Self {
        Self {
            held_out: settings.held_out,
            hold_out: settings.hold_out,
        }
    }
}

impl Settings {
    /// Greatest number of bounces: the setting, or two for the paper solver, or no limit.
    pub fn max_bounces(&self) -> u32 {
        match (self.bounces, self.preset) {
            (0, Preset::Paper) => PAPER_BOUNCES,
            (0, _) => u32::MAX,
            (bounces, _) => u32::try_from(bounces).unwrap_or(u32::MAX),
        }
    }
}

impl Parameter {
    /// Current value.
    pub fn get(&self, settings: &Settings) -> Value {
        (self.get)(settings)
    }

    /// Sets the value if it is of the right kind and in range.
    ///
    /// # Errors
    /// A sentence with the allowed values.
    pub fn set(&self, settings: &mut Settings, value: &Value) -> Result<(), String> {
        let allowed = match (self.kind, value) {
            (Kind::Whole { min, max }, Value::Whole(n)) => (min..=max).contains(n),
            (Kind::Whole { min, max }, Value::Real(x)) => *x >= min as f64 && *x <= max as f64,
            (Kind::Real { min, max, .. }, Value::Real(x)) => *x >= min && *x <= max,
            (Kind::Real { min, max, .. }, Value::Whole(n)) => *n as f64 >= min && *n as f64 <= max,
            _ => true,
        };
        if allowed && (self.set)(settings, value) {
            Ok(())
        } else {
            Err(format!("{} must be {}", self.name, self.allowed()))
        }
    }

    /// The allowed values, in words.
    pub fn allowed(&self) -> String {
        match self.kind {
            Kind::Flag => "true or false".to_owned(),
            Kind::Whole { min, max } => format!("a whole number from {min} to {max}"),
            Kind::Real { min, max, .. } => format!("a number from {min} to {max}"),
            Kind::Choice(words) => format!("one of {}", words.join(", ")),
        }
    }

    /// Parses a value from the command line.
    ///
    /// # Errors
    /// A sentence with the allowed values.
    pub fn parse(&self, text: &str) -> Result<Value, String> {
        let value = match self.kind {
            Kind::Flag => text.parse().ok().map(Value::Flag),
            Kind::Whole { .. } => text.parse().ok().map(Value::Whole),
            Kind::Real { .. } => text.parse().ok().map(Value::Real),
            Kind::Choice(_) => Some(Value::Choice(text.to_owned())),
        };
        value.ok_or_else(|| format!("{} must be {}", self.name, self.allowed()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An allowed value other than the default.
    fn other(parameter: &Parameter) -> Value {
        let default = parameter.get(&Settings::default());
        let values = match parameter.kind {
            Kind::Flag => [true, false].map(Value::Flag).to_vec(),
            Kind::Whole { min, max } => [min, max].map(Value::Whole).to_vec(),
            Kind::Real { min, max, .. } => [min, max].map(Value::Real).to_vec(),
            Kind::Choice(words) => (words.iter())
                .map(|word| Value::Choice((*word).to_owned()))
                .collect(),
        };
        let found = values.into_iter().find(|value| *value != default);
        found.expect("more than one value is allowed")
    }

    #[test]
    fn every_value_round_trips_and_changes_its_own_parameter_alone() {
        for changed in PARAMETERS {
            let mut settings = Settings::default();
            let value = other(changed);
            assert_eq!(changed.set(&mut settings, &value), Ok(()));
            for parameter in PARAMETERS {
                let expected = match parameter.name == changed.name {
                    true => value.clone(),
                    false => parameter.get(&Settings::default()),
                };
                assert_eq!(parameter.get(&settings), expected, "{}", parameter.name);
            }
            // And back.
            let default = changed.get(&Settings::default());
            assert_eq!(changed.set(&mut settings, &default), Ok(()));
            assert_eq!(settings, Settings::default(), "{}", changed.name);
        }
    }

    #[test]
    fn what_is_out_of_range_or_of_another_kind_is_refused_with_the_range() {
        let mut settings = Settings::default();
        let named = |name| (PARAMETERS.iter().find(|p| p.name == name)).expect("declared");
        let batch = named("batch");
        let message = batch.set(&mut settings, &Value::Whole(0)).unwrap_err();
        assert!(message.contains("from 1 to 1000000"), "{message}");
        assert!(batch.parse("many").is_err());
        let fastest = Value::Choice("fastest".into());
        assert!(named("preset").set(&mut settings, &fastest).is_err());
        assert_eq!(settings, Settings::default());
    }
}
