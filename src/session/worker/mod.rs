//! The worker: a thread that owns the estimate, solves, and serves views, saves and exports at any time.

mod backend;
mod commands;
mod earlier;
mod next;
mod state;
mod steering;
mod work;

pub use backend::{Backend, Opener, Solver, Wake};

use crate::error::{Error, Result};
use crate::inverse::settings::Settings;
use crate::session::command::{Command, Start};
use crate::session::inbox::{self, Outbox};
use crate::session::slot::Slot;
use crate::session::snapshot::Snapshot;
use next::{Begin, Next};
use state::Worker;
use std::sync::Arc;
use std::thread::JoinHandle;

/// A handle to a worker. Dropping it ends the worker.
pub struct Session {
    outbox: Option<Outbox>,
    slot: Arc<Slot>,
    thread: Option<JoinHandle<()>>,
}

impl Session {
    /// Starts a worker with what to open first.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn spawn(start: Option<Start>, settings: Settings, wake: Wake) -> Result<Self> {
        Self::spawn_with(start, settings, wake, Backend::default())
    }

    /// Starts a worker with other functions for opening and solving.
    ///
    /// # Errors
    /// The thread cannot be started.
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

    /// Sends a command without blocking. False if the queue is full ([`inbox::CAPACITY`]) or the worker has ended. Of
    /// views, insertions and edits only the newest is kept, so they never fill the queue.
    pub fn send(&self, command: Command) -> bool {
        self.outbox
            .as_ref()
            .is_some_and(|outbox| outbox.send(command))
    }

    /// The newest snapshot, without waiting.
    pub fn latest(&self) -> Arc<Snapshot> {
        self.slot.latest()
    }

    /// Ends the worker after the commands sent so far, and waits for it.
    pub fn join(self) {
        drop(self);
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        // Closing the queue ends the worker.
        self.outbox = None;
        if let Some(thread) = self.thread.take() {
            // The worker catches its own panics; if it died anyway, nothing is left to save.
            let _ = thread.join();
        }
    }
}
