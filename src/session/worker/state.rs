//! The worker's state, its snapshots, and its next step.

use crate::error::Error;
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::inverse::solver::Checkpoint;
use crate::session::command::{OpenOptions, Regrouping, Source};
use crate::session::edits::{Edited, Edits};
use crate::session::inbox::Inbox;
use crate::session::painter::Requests;
use crate::session::rates::Rates;
use crate::session::slot::{FRAME, Slot};
use crate::session::snapshot::{Level, Snapshot};
use crate::session::store::SessionStore;
use crate::session::worker::{Backend, Wake};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

pub(super) enum Next {
    Wait,
    /// Open a capture, then continue its last session or solve it.
    Open(Source, OpenOptions, Begin),
    Resume(PathBuf),
    /// Solve the open capture, from the start or from a checkpoint.
    Solve(Option<Checkpoint>),
    /// Segment the mesh again because other pixels are held out, and solve from the start.
    Recut(Box<OpenOptions>),
    /// Read the open capture again with other options, and continue the solve if true.
    Reframe(Box<OpenOptions>, bool),
    /// Read the open capture again with other objects, and solve from the start. If that fails, continue the solve if true.
    Regroup(Box<Regrouping>, bool),
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

pub(super) struct Worker {
    pub inbox: Inbox,
    pub slot: Arc<Slot>,
    /// What the painter is to draw.
    pub requests: Arc<Requests>,
    pub wake: Wake,
    pub backend: Backend,
    /// What snapshots show, without rates, sessions and what the slot adds. Its edits are changed by [`Worker::set_edits`], so that the
    /// pictures follow.
    pub state: Snapshot,
    pub checkpoint: Option<Checkpoint>,
    pub rates: Rates,
    pub solving: bool,
    pub paused: bool,
    pub step: bool,
    pub seconds_load: f64,
    pub started: Instant,
    pub store: SessionStore,
    /// Whether the parameters were given explicitly at the start of the program, and so take precedence over a session's.
    pub explicit_settings: bool,
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
            checkpoint: None,
            rates: Rates::default(),
            solving: false,
            paused: false,
            step: false,
            seconds_load: 0.0,
            started: Instant::now(),
            store: SessionStore::new(backend.sessions.clone()),
            explicit_settings: settings != Settings::default(),
            edited: Edited::default(),
            changed: true,
            published: Instant::now(),
            backend,
            state: Snapshot {
                settings,
                ..Snapshot::default()
            },
        }
    }

    /// Drops the estimate and the progress of its solve.
    pub fn forget(&mut self) {
        self.state.estimate = Arc::default();
        self.state.progress = Arc::default();
        self.checkpoint = None;
        self.rates = Rates::default();
    }

    /// The estimate with the edits, which everything but the solver and the report uses.
    pub fn edited(&mut self) -> Arc<Estimate> {
        self.edited.of(&self.state.estimate, &self.state.edits)
    }

    pub fn fail(&mut self, error: &Error) {
        self.say(Level::Error, error.to_string());
    }

    pub fn say(&mut self, level: Level, message: impl Into<String>) {
        self.slot.say(level, message.into());
        self.changed = true;
    }

    /// Replaces the edits.
    pub fn set_edits(&mut self, edits: Edits) {
        self.requests.edit(&edits);
        self.state.edits = edits;
    }

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
        let (state, solving) = (&self.state, self.solving && !self.paused);
        (self.requests).follow(&state.estimate, &state.settings, solving);
        let seconds_left = self.rates.seconds_left(&state.progress, &state.settings);
        self.slot.put(Snapshot {
            iterations_per_second: self.rates.iterations(),
            rays_per_second: self.rates.rays(),
            seconds_left: seconds_left.filter(|_| self.solving),
            kept: self.store.kept(),
            ..state.clone()
        });
        (self.wake)();
    }
}
