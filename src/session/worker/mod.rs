//! The worker: a named thread that owns the estimate, solves, and serves views, saves and exports at any time.

mod commands;
mod earlier;
mod state;
mod steering;
mod work;

use crate::calibrate::problem::Problem;
use crate::error::{Error, Result};
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Checkpoint, Observer, Solution};
use crate::session::command::{Command, OpenOptions, Source, Start};
use crate::session::inbox::{self, Outbox};
use crate::session::slot::Slot;
use crate::session::snapshot::{OpenCapture, Snapshot};
use state::Worker;
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;
use work::{Begin, Next};

/// Called by the worker after a new snapshot, at most about 30 times a second.
pub type Wake = Arc<dyn Fn() + Send + Sync>;

/// Reads a capture.
pub type Opener = dyn Fn(&Source, &OpenOptions) -> Result<OpenCapture> + Send;

/// Runs a solver to its end.
pub type Solver = dyn FnMut(&Problem, &Settings, Option<&Checkpoint>, &mut dyn Observer) -> Result<Solution>
    + Send;

/// What the worker calls to do its work.
pub struct Backend {
    /// Reads a capture.
    pub open: Box<Opener>,
    /// Runs a solver.
    pub solve: Box<Solver>,
    /// The folder that sessions save themselves into; none where they do not.
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

/// The handle on a worker. Dropping it ends the worker.
pub struct Session {
    outbox: Option<Outbox>,
    slot: Arc<Slot>,
    thread: Option<JoinHandle<()>>,
}

impl Session {
    /// Starts a worker and lets it begin with what is given.
    ///
    /// # Errors
    /// The system grants no thread.
    pub fn spawn(start: Option<Start>, settings: Settings, wake: Wake) -> Result<Self> {
        Self::spawn_with(start, settings, wake, Backend::default())
    }

    /// Starts a worker that reads and solves by `backend`.
    ///
    /// # Errors
    /// The system grants no thread.
    pub fn spawn_with(
        start: Option<Start>,
        settings: Settings,
        wake: Wake,
        backend: Backend,
    ) -> Result<Self> {
        let (outbox, inbox) = inbox::queue();
        let slot = Arc::new(Slot::default());
        let shared = slot.clone();
        let first = match start {
            None => Next::Wait,
            Some(Start::Capture(source, options)) => Next::Open(source, options, Begin::GoingOn),
            Some(Start::Results(folder)) => Next::Resume(folder),
        };
        let thread = std::thread::Builder::new()
            .name("relit-worker".to_owned())
            .spawn(move || Worker::new(inbox, shared, settings, wake, backend).run(first))
            .map_err(|error| {
                Error::new(
                    "worker thread",
                    error,
                    "close other programs and start again",
                )
            })?;
        Ok(Self {
            outbox: Some(outbox),
            slot,
            thread: Some(thread),
        })
    }

    /// Sends a command without ever waiting; false if the queue is full ([`inbox::CAPACITY`]) or the worker has ended.
    /// Of views, insertions and edits only the newest waits, so that those never fill the queue.
    pub fn send(&self, command: Command) -> bool {
        self.outbox
            .as_ref()
            .is_some_and(|outbox| outbox.send(command))
    }

    /// The newest snapshot, without waiting.
    pub fn latest(&self) -> Arc<Snapshot> {
        self.slot.latest()
    }

    /// Ends the worker after the commands sent so far and waits until it has ended.
    pub fn join(self) {
        drop(self);
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        // A closed queue is the order to end.
        self.outbox = None;
        if let Some(thread) = self.thread.take() {
            // The worker contains its own panics; if it died all the same, there is nothing left to save.
            let _ = thread.join();
        }
    }
}
