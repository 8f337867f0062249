//! The worker's next step.

use crate::calibrate::held_out::HoldOut;
use crate::inverse::solver::Checkpoint;
use crate::session::command::{OpenOptions, Regrouping, Source};
use std::path::PathBuf;

/// The worker's next step.
pub(super) enum Next {
    /// Wait for commands.
    Wait,
    /// Open a capture, then continue its last session or solve it.
    Open(Source, OpenOptions, Begin),
    /// Load results of an earlier run and continue them.
    Resume(PathBuf),
    /// Solve the open capture, from the start or from a checkpoint.
    Solve(Option<Checkpoint>),
    /// Segment the mesh again because other pixels are held out, and solve from the start.
    Recut(HoldOut),
    /// Read the open capture again with other options, and continue the solve if true.
    Reframe(Box<OpenOptions>, bool),
    /// Read the open capture again with other objects, and solve from the start. If that fails, continue the solve if true.
    Regroup(Box<Regrouping>, bool),
    /// End.
    Quit,
}

/// How a capture is opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Begin {
    /// With its last session, if there is one.
    GoingOn,
    /// In a new session.
    Anew,
}
