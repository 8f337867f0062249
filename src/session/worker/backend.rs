//! The functions that the worker calls.

use crate::calibrate::problem::Problem;
use crate::error::Result;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Checkpoint, Observer, Solution};
use crate::session::command::{OpenOptions, Source};
use crate::session::open_capture::OpenCapture;
use std::path::PathBuf;
use std::sync::Arc;

/// Called by the worker after a new snapshot, at most about 30 times a second.
pub type Wake = Arc<dyn Fn() + Send + Sync>;

/// Opens a capture.
pub type Opener = dyn Fn(&Source, &OpenOptions) -> Result<OpenCapture> + Send;

/// Runs a solver until it ends.
pub type Solver = dyn FnMut(&Problem, &Settings, Option<&Checkpoint>, &mut dyn Observer) -> Result<Solution>
    + Send;

/// Functions that the worker calls; replaced in tests.
pub struct Backend {
    /// Reads a capture.
    pub open: Box<Opener>,
    /// Runs a solver.
    pub solve: Box<Solver>,
    /// The folder of automatically saved sessions; `None` to save none.
    pub sessions: Option<PathBuf>,
}

impl Default for Backend {
    fn default() -> Self {
        Self {
            open: Box::new(crate::session::open::open),
            solve: Box::new(crate::inverse::solve),
            sessions: None,
        }
    }
}
