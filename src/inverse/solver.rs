//! What a solver is given, what it reports while it runs, and how it ends.

use crate::error::{Error, Result};
use crate::inverse::estimate::Estimate;
use crate::inverse::known::Known;
use crate::inverse::settings::Settings;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How far a solve has come. Handed out between iterations.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// What is being done now, e.g. "tracing paths".
    pub phase: String,
    /// Work done in the current phase, 0 to 1, where that is known.
    pub fraction: Option<f32>,
    /// Iterations (optimiser steps) so far.
    pub iterations: u64,
    /// Rays traced so far, shadow rays included.
    pub rays: u64,
    /// Seconds of solving so far, pauses excluded.
    pub seconds: f64,
    /// Seconds until the first estimate that can be shown.
    pub seconds_to_first_estimate: Option<f64>,
    /// Loss curve, in time order.
    pub losses: Vec<LossPoint>,
    /// The course of the fit, a point an iteration; the paper's descent has none.
    #[serde(default)]
    pub fits: Vec<FitPoint>,
    /// Finished stages of the ladder.
    pub stages: Vec<Stage>,
    /// Samples dropped, by cause.
    pub rejected: BTreeMap<String, u64>,
    /// What a person should know.
    pub warnings: Vec<String>,
}

/// One point of the loss curve: mean absolute difference over pixels and channels, in linear radiance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LossPoint {
    /// Seconds of solving.
    pub seconds: f64,
    /// Iterations.
    pub iteration: u64,
    /// Over pixels in the fit; `None` where it was not measured.
    pub train: Option<f64>,
    /// Over held-out pixels; `None` where it was not measured.
    pub held_out: Option<f64>,
}

/// The fit after one iteration. Stored paths give it without a ray.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FitPoint {
    /// Seconds of solving.
    pub seconds: f64,
    /// Iterations.
    pub iteration: u64,
    /// Root of the mean squared residual of the pixels in the fit, relative to their level.
    pub residual: f64,
    /// The error that the estimate claims: median relative standard error of albedo; `None` before there is one.
    pub stderr: Option<f64>,
    /// Free parameters.
    pub unknowns: u64,
}

/// One rung of the model ladder, tried and kept or not.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stage {
    /// What was added, e.g. "objects".
    pub name: String,
    /// What it cost.
    pub seconds: f64,
    /// Iterations spent.
    pub iterations: u64,
    /// Loss in the fit at its end.
    pub train_loss: Option<f64>,
    /// Loss on held-out pixels at its end.
    pub held_out_loss: Option<f64>,
    /// Whether it stayed in the model.
    pub kept: bool,
    /// Why, in a sentence.
    pub why: String,
}

/// What the observer wants next.
#[derive(Debug, Clone, PartialEq)]
pub enum Control {
    /// Go on.
    Continue,
    /// Go on with other values of the live parameters.
    Change(Box<Settings>),
    /// End now with what there is.
    Stop,
}

/// Listens to a running solver: at least every 50 ms, between iterations, on the solver's thread.
///
/// The observer may take its time (a pause is an observer that does not return); the solver's clock excludes it.
pub trait Observer {
    /// Hears how far the solve has come and may steer it.
    fn observe(&mut self, progress: &Progress, estimate: &Estimate) -> Control;

    /// What is known beforehand and is to be held; asked for once, at the start.
    fn known(&self) -> Known {
        Known::default()
    }

    /// Is offered a checkpoint of where the solve stands, just before it hears of it by [`Observer::observe`]; one that
    /// wants to keep it calls `make`. Solvers that can be taken up again offer it wherever they call `observe`.
    fn offer(&mut self, make: &dyn Fn() -> Checkpoint) {
        let _ = make;
    }
}

/// Why a solve ended; the word in `report.json`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Termination {
    /// The estimate stands still within its reported error.
    Converged,
    /// The reported error is as small as was asked for.
    Target,
    /// The time is up.
    Time,
    /// The step limit is reached.
    Steps,
    /// The observer stopped it.
    Cancelled,
    /// The iteration left the finite numbers; the last finite estimate is returned.
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

/// Where a solve can be taken up again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// How far it had come: clock, counters and loss curve go on from here.
    pub progress: Progress,
    /// The solver's own state, as JSON; opaque to everyone but the solver that wrote it.
    pub state: serde_json::Value,
}

impl Checkpoint {
    /// Writes a solver's state down. A state that cannot be written becomes `null`, which no solver takes up.
    pub fn new(progress: &Progress, state: &impl Serialize) -> Self {
        Self {
            progress: progress.clone(),
            state: serde_json::to_value(state).unwrap_or_default(),
        }
    }

    /// The state, if it is one that `fits` accepts.
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

/// How a solve ended.
#[derive(Debug, Clone)]
pub struct Solution {
    /// What was found.
    pub estimate: Estimate,
    /// The last progress.
    pub progress: Progress,
    /// Why it ended.
    pub termination: Termination,
    /// Where to go on from, unless there is nothing left to do.
    pub checkpoint: Option<Checkpoint>,
}
