//! The interface of solvers: progress, observer, checkpoints and solution.

use crate::error::{Error, Result};
use crate::inverse::estimate::Estimate;
use crate::inverse::known::Known;
use crate::inverse::settings::Settings;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The progress of a solve, reported between iterations.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Name of the present phase, e.g. "tracing paths".
    pub phase: String,
    /// Completed fraction of the present phase, if it is known.
    pub fraction: Option<f32>,
    /// Iterations (optimiser steps) so far.
    pub iterations: u64,
    /// Rays traced so far, shadow rays included.
    pub rays: u64,
    /// Seconds of solving so far, pauses excluded.
    pub seconds: f64,
    /// Seconds until the first estimate.
    pub seconds_to_first_estimate: Option<f64>,
    /// Loss curve, in time order.
    pub losses: Vec<LossPoint>,
    /// The residual of the fit after each iteration; empty for the paper's descent.
    #[serde(default)]
    pub fits: Vec<FitPoint>,
    /// Residuals of textures, one object after the other.
    #[serde(default)]
    pub textures: Vec<TexturePoint>,
    /// Finished stages of the pipeline.
    pub stages: Vec<Stage>,
    /// Number of rejected samples, by cause.
    pub rejected: BTreeMap<String, u64>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// One point of the loss curve: mean absolute difference over pixels and channels, in linear radiance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LossPoint {
    /// Seconds of solving.
    pub seconds: f64,
    /// Iterations.
    pub iteration: u64,
    /// Over pixels in the fit; `None` if it was not measured.
    pub train: Option<f64>,
    /// Over held-out pixels; `None` if it was not measured.
    pub held_out: Option<f64>,
}

/// The fit after one iteration, evaluated on stored paths.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FitPoint {
    /// Seconds of solving.
    pub seconds: f64,
    /// Iterations.
    pub iteration: u64,
    /// Root mean square of the residuals of pixels in the fit, relative to their level.
    pub residual: f64,
    /// The reported error: median relative standard error of albedo; `None` before the first estimate.
    pub stderr: Option<f64>,
    /// Number of free parameters.
    pub unknowns: u64,
}

/// The fit of an object's texture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TexturePoint {
    /// Seconds of solving.
    pub seconds: f64,
    /// Iterations.
    pub iteration: u64,
    /// Root mean square residual of the object's cross-validated pixels, in units of its mean albedo.
    pub residual: f64,
}

/// A finished stage of the pipeline.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Stage {
    /// Its name, e.g. "objects".
    pub name: String,
    /// Its duration.
    pub seconds: f64,
    /// Seconds of solving at its end.
    #[serde(default)]
    pub ended: f64,
    /// Number of iterations.
    pub iterations: u64,
    /// Loss in the fit at its end.
    pub train_loss: Option<f64>,
    /// Loss on held-out pixels at its end.
    pub held_out_loss: Option<f64>,
    /// Whether its result is kept.
    pub kept: bool,
    /// The reason, in a sentence.
    pub why: String,
}

/// The observer's answer to a report.
#[derive(Debug, Clone, PartialEq)]
pub enum Control {
    /// Continue.
    Continue,
    /// Continue with other values of the live parameters.
    Change(Box<Settings>),
    /// Stop with the present estimate.
    Stop,
}

/// Receives reports of a running solver: at least every 50 ms, between iterations, on the solver's thread.
///
/// The solver's clock excludes the time in the observer, so an observer pauses the solve by not returning.
pub trait Observer {
    /// Receives the progress and the present estimate.
    fn observe(&mut self, progress: &Progress, estimate: &Estimate) -> Control;

    /// Known values to hold fixed; requested once, at the start.
    fn known(&self) -> Known {
        Known::default()
    }

    /// Offers a checkpoint just before each [`Observer::observe`]. An observer that keeps it calls `make`.
    fn offer(&mut self, make: &dyn Fn() -> Checkpoint) {
        let _ = make;
    }
}

/// Why a solve ended, as in `report.json`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Termination {
    /// The estimate has converged within its reported error.
    Converged,
    /// The reported error is below the target.
    Target,
    /// The time limit was reached.
    Time,
    /// The step limit was reached.
    Steps,
    /// The observer stopped it.
    Cancelled,
    /// The gradient was not finite; the last finite estimate is returned.
    Diverged,
}

impl Termination {
    /// The word in `report.json`.
    pub fn word(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::Target => "target",
            Self::Time => "time",
            Self::Steps => "steps",
            Self::Cancelled => "cancelled",
            Self::Diverged => "diverged",
        }
    }
}

/// A state from which a solve can be resumed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// The progress: clock, counters and loss curve continue from here.
    pub progress: Progress,
    /// The solver's state as JSON, readable by the same solver only.
    pub state: serde_json::Value,
}

impl Checkpoint {
    /// Serialises a solver's state. A state that cannot be serialised becomes `null`, which no solver accepts.
    pub fn new(progress: &Progress, state: &impl Serialize) -> Self {
        Self {
            progress: progress.clone(),
            state: serde_json::to_value(state).unwrap_or_default(),
        }
    }

    /// The state, if `fits` accepts it.
    ///
    /// # Errors
    /// It belongs to another capture or another solver.
    pub fn state<T: DeserializeOwned>(&self, fits: impl FnOnce(&T) -> bool) -> Result<T> {
        let state = T::deserialize(&self.state).ok().filter(fits);
        state.ok_or_else(|| {
            Error::new(
                "checkpoint",
                "belongs to another capture or another solver",
                "name the preset that it was made with, or start a new solve",
            )
        })
    }
}

/// The result of a solve.
#[derive(Debug, Clone)]
pub struct Solution {
    /// The estimate.
    pub estimate: Estimate,
    /// The final progress.
    pub progress: Progress,
    /// Why it ended.
    pub termination: Termination,
    /// Where to resume; `None` if nothing is left to do.
    pub checkpoint: Option<Checkpoint>,
}
