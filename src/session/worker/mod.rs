//! The worker: a thread that owns the estimate, solves, saves and exports.

mod commands;
mod earlier;
mod state;
mod steering;
mod work;

use crate::calibrate::problem::Problem;
use crate::error::{Error, Result};
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Checkpoint, Observer, Solution};
use crate::render::Renderer;
use crate::session::command::{Command, OpenOptions, Source, Start};
use crate::session::inbox::{self, Outbox};
use crate::session::open_capture::OpenCapture;
use crate::session::painter::{Painter, Requests};
use crate::session::slot::Slot;
use crate::session::snapshot::Snapshot;
use state::{Begin, Next, Worker};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread::JoinHandle;

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
    /// What traces paths of pictures.
    pub renderer: Renderer,
}

impl Default for Backend {
    fn default() -> Self {
        Self {
            open: Box::new(crate::session::open::open),
            solve: Box::new(crate::inverse::solve),
            sessions: None,
            renderer: Renderer::processor(),
        }
    }
}

/// A handle to a worker and a painter. Dropping it ends both.
pub struct Session {
    outbox: Option<Outbox>,
    requests: Arc<Requests>,
    slot: Arc<Slot>,
    worker: Option<JoinHandle<()>>,
    painter: Option<JoinHandle<()>>,
}

impl Session {
    /// Starts both with what to open first.
    ///
    /// # Errors
    /// The threads cannot be started.
    pub fn spawn(start: Option<Start>, settings: Settings, wake: Wake) -> Result<Self> {
        Self::spawn_with(start, settings, wake, Backend::default())
    }

    /// Starts both with other functions for opening and solving.
    ///
    /// # Errors
    /// The threads cannot be started.
    pub fn spawn_with(
        start: Option<Start>,
        settings: Settings,
        wake: Wake,
        backend: Backend,
    ) -> Result<Self> {
        let (outbox, inbox) = inbox::queue();
        let slot = Arc::new(Slot::default());
        let requests = Arc::new(Requests::default());
        let first = match start {
            None => Next::Wait,
            Some(Start::Capture(source, options)) => Next::Open(source, options, Begin::GoingOn),
            Some(Start::Results(folder)) => Next::Resume(folder),
        };
        let renderer = backend.renderer.clone();
        let painter = Painter::new(requests.clone(), slot.clone(), wake.clone(), renderer)?;
        let shared = (slot.clone(), requests.clone());
        let worker = move || Worker::new(inbox, shared, settings, wake, backend).run(first);
        Ok(Self {
            outbox: Some(outbox),
            requests,
            slot,
            worker: Some(thread("relit-worker", worker)?),
            painter: Some(thread("relit-painter", || painter.run())?),
        })
    }

    /// Sends a command without blocking. False if the queue is full ([`inbox::CAPACITY`]) or the worker has ended. Of
    /// views, insertions and edits only the newest is kept, so they never fill the queue.
    pub fn send(&self, command: Command) -> bool {
        if self.requests.take(&command) {
            return true;
        }
        let outbox = self.outbox.as_ref();
        outbox.is_some_and(|outbox| outbox.send(command))
    }

    /// The newest snapshot, without waiting.
    pub fn latest(&self) -> Arc<Snapshot> {
        self.slot.latest()
    }

    /// Ends the worker after the commands sent so far, and the painter, and waits for both.
    pub fn join(self) {
        drop(self);
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        // Closing the queue ends the worker.
        self.outbox = None;
        // The worker catches its own panics; if it died anyway, nothing is left to save.
        let _ = self.worker.take().map(JoinHandle::join);
        self.requests.quit();
        let _ = self.painter.take().map(JoinHandle::join);
    }
}

fn thread(name: &str, run: impl FnOnce() + Send + 'static) -> Result<JoinHandle<()>> {
    let thread = std::thread::Builder::new().name(name.to_owned()).spawn(run);
    thread.map_err(|error| Error::new(name, error, "close other programs and start again"))
}
