//! A measurement of error over time.

use crate::study::machine::Machine;
use crate::study::trade::compare;
use crate::study::trade::curve::{Curve, Measure};
use crate::study::trade::front;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// Measured curves of error over time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trade {
    /// The program's version.
    pub relit: String,
    /// Name of the capture, or of the generated rooms.
    pub capture: String,
    /// Hash of the capture's content; `None` for generated rooms.
    pub hash: Option<String>,
    /// The machine of the measurement.
    pub machine: Machine,
    /// Random seed of the solves.
    pub seed: u64,
    /// Number of captures over which points are means.
    pub captures: u64,
    /// The quantity that is measured as the error.
    pub measure: Measure,
    /// Duration of the measurement in seconds.
    pub seconds: f64,
    /// One curve for each solve.
    pub curves: Vec<Curve>,
    /// Conclusions, each a sentence.
    pub findings: Vec<String>,
}

impl Trade {
    /// A trade of one capture from its curves, in the order of [`plan`](crate::study::trade::plan). Marks the Pareto
    /// front and draws conclusions.
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
