//! What runs beside the window: the worker, and work on threads of its own.

use crate::app::shell::dialogs::Dialogs;
use crate::app::shell::notices::Notices;
use crate::app::shell::status::Batch;
use crate::app::task::Task;
use crate::app::trade::Measured;
use crate::app::worker::Worker;
use std::path::PathBuf;

/// What runs.
pub struct Jobs {
    /// The worker.
    pub worker: Worker,
    /// Photographs that are being written.
    pub batch: Option<Batch>,
    /// A scan that is being imported, and the folder of the capture that is made of it.
    pub importing: Option<(PathBuf, Task<(), Vec<String>>)>,
    /// The trade of speed for exactness, read or being measured.
    pub measured: Measured,
    /// File dialogs.
    pub dialogs: Dialogs,
    /// What is said of all that runs.
    pub notices: Notices,
}

impl Jobs {
    /// With nothing under way.
    pub fn new(worker: Worker) -> Self {
        Self {
            worker,
            batch: None,
            importing: None,
            measured: Measured::default(),
            dialogs: Dialogs::default(),
            notices: Notices::default(),
        }
    }
}
