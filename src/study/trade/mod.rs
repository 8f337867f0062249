//! The trade of speed for exactness, measured: error over seconds for presets and for single settings around them.
//!
//! One solve gives many points, because an observer watches its error while it runs; the solver's clock leaves the
//! observer's time out.

pub mod combine;
pub mod compare;
mod file;
pub mod front;
mod judge;
mod measure;
pub mod plan;
pub mod plot;
pub mod rooms;
mod words;

pub use judge::Judge;
pub use measure::{Heard, measure, watch};

use crate::inverse::settings::Settings;
use crate::inverse::solver::Termination;
use crate::study::machine::Machine;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// What is measured as the error.
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

/// A measured trade.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trade {
    /// The program's version.
    pub relit: String,
    /// Name of the capture, or of the generated rooms.
    pub capture: String,
    /// Hash of the capture's content; `None` for generated rooms.
    pub hash: Option<String>,
    /// What it was measured on.
    pub machine: Machine,
    /// Key of all random numbers.
    pub seed: u64,
    /// Captures over which points are means.
    pub captures: u64,
    /// What is measured as the error.
    pub measure: Measure,
    /// Seconds that the measurement took.
    pub seconds: f64,
    /// One curve a solve.
    pub curves: Vec<Curve>,
    /// What follows from the curves, each a sentence.
    pub findings: Vec<String>,
}

impl Trade {
    /// A trade of one capture from its curves, in the order of [`plan`]; marks the front and draws conclusions.
    pub fn new(
        capture: &str,
        hash: Option<String>,
        measure: Measure,
        elapsed: Duration,
        mut curves: Vec<Curve>,
    ) -> Self {
        front::mark(&mut curves);
        let findings = match measure {
            Measure::Albedo => compare::against_paper(&curves),
            Measure::HeldOut => Vec::new(),
        };
        Self {
            relit: env!("CARGO_PKG_VERSION").to_owned(),
            capture: capture.to_owned(),
            hash,
            machine: Machine::here(),
            seed: curves.first().map_or(0, |curve| curve.settings.seed),
            captures: 1,
            measure,
            seconds: elapsed.as_secs_f64(),
            curves,
            findings,
        }
    }
}

/// The course of one solve, or the mean course of the same solve on several captures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// Name of the preset, followed by what differs from it.
    pub name: String,
    /// Whether it is a preset as it is, with nothing changed.
    pub is_preset: bool,
    /// The parameters.
    pub settings: Settings,
    /// Why it ended; `None` for a mean over captures.
    pub ended: Option<Termination>,
    /// Points whose error was no finite number, and which are left out.
    pub rejected: u64,
    /// In order of seconds.
    pub points: Vec<Point>,
}

/// Where a solve stood.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Seconds of solving, from the start of the solve; loading is not counted.
    pub seconds: f64,
    /// The error then; over several captures its geometric mean.
    pub error: f64,
    /// One standard deviation of the error's logarithm below and above, over several captures.
    pub spread: Option<[f64; 2]>,
    /// The relative error of albedo that the estimate claims of itself; see
    /// [`Estimate::relative_error`](crate::inverse::estimate::Estimate::relative_error).
    pub reported: Option<f64>,
    /// Rays cast so far.
    pub rays: u64,
    /// Iterations so far.
    pub iterations: u64,
    /// Whether no other point of any curve is both earlier and more exact.
    pub pareto: bool,
}
