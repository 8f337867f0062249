//! The worker's state, its snapshots, and its next step.

use crate::calibrate::held_out::HoldOut;
use crate::compose::placement::Placement;
use crate::error::Error;
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Checkpoint, Progress};
use crate::session::command::{OpenOptions, Regrouping, Source};
use crate::session::edits::{Edited, Edits};
use crate::session::inbox::Inbox;
use crate::session::open_capture::OpenCapture;
use crate::session::painter::Requests;
use crate::session::rates::Rates;
use crate::session::slot::{FRAME, Slot};
use crate::session::snapshot::{Level, Phase, Snapshot};
use crate::session::store::SessionStore;
use crate::session::worker::backend::{Backend, Wake};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

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

/// Everything the worker owns.
pub(super) struct Worker {
    pub inbox: Inbox,
    pub slot: Arc<Slot>,
    /// What the painter is to draw.
    pub requests: Arc<Requests>,
    pub wake: Wake,
    pub backend: Backend,
    pub settings: Settings,
    pub capture: Option<Arc<OpenCapture>>,
    /// The estimate of the solver.
    pub estimate: Arc<Estimate>,
    /// Edits of the estimate; changed by [`Worker::set_edits`], so that the pictures follow.
    pub edits: Edits,
    pub progress: Arc<Progress>,
    pub checkpoint: Option<Checkpoint>,
    pub phase: Phase,
    pub rates: Rates,
    pub solving: bool,
    pub paused: bool,
    pub step: bool,
    pub seconds_load: f64,
    pub started: Instant,
    /// Saves the session automatically.
    pub store: SessionStore,
    /// The inserted objects of the session that the open capture continues.
    pub inserted: Arc<Vec<Placement>>,
    /// The frame to show first.
    pub frame: usize,
    /// Name of the session that the open capture continues.
    pub continued: Option<String>,
    /// Whether the parameters were given explicitly at the start of the program, and so take precedence over a session's.
    pub explicit_settings: bool,
    /// Number of answered commands to change objects.
    pub regroupings: u64,
    edited: Edited,
    changed: bool,
    published: Instant,
}

impl Worker {
    pub fn new(
        inbox: Inbox,
        (slot, requests): (Arc<Slot>, Arc<Requests>),
        settings: Settings,
        wake: Wake,
        backend: Backend,
    ) -> Self {
        Self {
            inbox,
            slot,
            requests,
            wake,
            capture: None,
            estimate: Arc::default(),
            edits: Edits::default(),
            progress: Arc::default(),
            checkpoint: None,
            phase: Phase::Idle,
            rates: Rates::default(),
            solving: false,
            paused: false,
            step: false,
            seconds_load: 0.0,
            started: Instant::now(),
            store: SessionStore::new(backend.sessions.clone()),
            inserted: Arc::default(),
            frame: 0,
            continued: None,
            explicit_settings: settings != Settings::default(),
            regroupings: 0,
            edited: Edited::default(),
            changed: true,
            published: Instant::now(),
            backend,
            settings,
        }
    }

    /// Drops the estimate and the progress of its solve.
    pub fn forget(&mut self) {
        self.estimate = Arc::default();
        self.progress = Arc::default();
        self.checkpoint = None;
        self.rates = Rates::default();
    }

    /// The estimate with the edits, which everything but the solver and the report uses.
    pub fn edited(&mut self) -> Arc<Estimate> {
        self.edited.of(&self.estimate, &self.edits)
    }

    /// Records an error as an event.
    pub fn fail(&mut self, error: &Error) {
        self.say(Level::Error, error.to_string());
    }

    /// Records an event.
    pub fn say(&mut self, level: Level, message: impl Into<String>) {
        self.slot.say(level, message.into());
        self.changed = true;
    }

    /// Replaces the edits.
    pub fn set_edits(&mut self, edits: Edits) {
        self.requests.edit(&edits);
        self.edits = edits;
    }

    /// Marks the state as changed.
    pub fn touch(&mut self) {
        self.changed = true;
    }

    /// Publishes a snapshot if the state has changed: at once if `now`, else at most about 30 times a second.
    pub fn publish(&mut self, now: bool) {
        if !now && (!self.changed || self.published.elapsed() < FRAME) {
            return;
        }
        self.changed = false;
        self.published = Instant::now();
        let (requests, solving) = (&self.requests, self.solving && !self.paused);
        requests.follow(&self.estimate, &self.settings, solving);
        let seconds_left = self.rates.seconds_left(&self.progress, &self.settings);
        self.slot.put(Snapshot {
            phase: self.phase.clone(),
            capture: self.capture.clone(),
            settings: self.settings.clone(),
            progress: self.progress.clone(),
            iterations_per_second: self.rates.iterations(),
            rays_per_second: self.rates.rays(),
            seconds_left: seconds_left.filter(|_| self.solving),
            estimate: self.estimate.clone(),
            edits: self.edits.clone(),
            regroupings: self.regroupings,
            inserted: self.inserted.clone(),
            frame: self.frame,
            continued: self.continued.clone(),
            kept: self.store.kept(),
            ..Snapshot::default()
        });
        (self.wake)();
    }
}
