//! Curves of error over time.

#[cfg(test)]
use crate::inverse::settings::Preset;
use crate::inverse::settings::Settings;
use crate::inverse::solver::Termination;
use serde::{Deserialize, Serialize};

/// The quantity that is measured as the error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Mean absolute error of albedo against the truth, over scored objects and RGB.
    Albedo,
    /// Mean absolute difference in radiance on pixels held out of the fit.
    HeldOut,
}

impl Measure {
    /// Name of an axis that shows it.
    pub fn label(self) -> &'static str {
        match self {
            Self::Albedo => "mean absolute error of albedo",
            Self::HeldOut => "held-out loss, radiance",
        }
    }
}

/// Error over time of one solve, or its mean over several captures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// Name of the preset, followed by what differs from it.
    pub name: String,
    /// Whether it is an unchanged preset.
    pub is_preset: bool,
    /// The parameters.
    pub settings: Settings,
    /// Why it ended; `None` for a mean over captures.
    pub ended: Option<Termination>,
    /// Number of points without a finite error, which are left out.
    pub rejected: u64,
    /// In order of seconds.
    pub points: Vec<Point>,
}

#[cfg(test)]
impl Curve {
    /// A preset's curve through (seconds, error) points.
    pub(super) fn through(preset: Preset, points: &[[f64; 2]]) -> Self {
        Self {
            name: preset.word().to_owned(),
            is_preset: true,
            settings: Settings {
                preset,
                ..Settings::default()
            },
            ended: None,
            rejected: 1,
            points: (points.iter())
                .map(|&[seconds, error]| Point {
                    seconds,
                    error,
                    spread: None,
                    reported: Some(error),
                    rays: 10,
                    iterations: 2,
                    pareto: false,
                })
                .collect(),
        }
    }
}

/// A measurement of a solve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Seconds of solving, from the start of the solve; loading is not counted.
    pub seconds: f64,
    /// The error; over several captures, its geometric mean.
    pub error: f64,
    /// Error ± one standard deviation of its logarithm, over several captures.
    pub spread: Option<[f64; 2]>,
    /// The relative error of albedo that the estimate reports of itself; see
    /// [`Estimate::relative_error`](crate::inverse::estimate::Estimate::relative_error).
    pub reported: Option<f64>,
    /// Rays cast so far.
    pub rays: u64,
    /// Iterations so far.
    pub iterations: u64,
    /// Whether no other point of any curve is both earlier and more accurate.
    pub pareto: bool,
}
