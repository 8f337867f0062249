//! The worker's state, and its snapshots.

use crate::compose::placement::Placement;
use crate::error::Error;
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Checkpoint, Progress};
use crate::session::edits::{Edited, Edits};
use crate::session::inbox::Inbox;
use crate::session::insertion::Inserting;
use crate::session::light::Light;
use crate::session::open_capture::OpenCapture;
use crate::session::rates::Rates;
use crate::session::slot::Slot;
use crate::session::snapshot::{Event, Level, Phase, Snapshot};
use crate::session::store::SessionStore;
use crate::session::view::Views;
use crate::session::worker::backend::{Backend, Wake};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Shortest time between two snapshots, unless one is requested.
pub(super) const FRAME: Duration = Duration::from_millis(33);

/// Everything the worker owns.
pub(super) struct Worker {
    pub inbox: Inbox,
    pub slot: Arc<Slot>,
    pub wake: Wake,
    pub backend: Backend,
    pub settings: Settings,
    pub capture: Option<Arc<OpenCapture>>,
    /// The estimate of the solver.
    pub estimate: Arc<Estimate>,
    /// Edits of the estimate.
    pub edits: Edits,
    pub progress: Arc<Progress>,
    pub checkpoint: Option<Checkpoint>,
    pub phase: Phase,
    pub events: Arc<Vec<Event>>,
    pub rates: Rates,
    pub views: Views,
    pub inserting: Inserting,
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
    /// Until when views get more of the solver's time.
    pub priority_until: Option<Instant>,
    /// Number of answered commands to change objects.
    pub regroupings: u64,
    edited: Edited,
    sequence: u64,
    changed: bool,
    published: Instant,
}

impl Worker {
    pub fn new(
        inbox: Inbox,
        slot: Arc<Slot>,
        settings: Settings,
        wake: Wake,
        backend: Backend,
    ) -> Self {
        Self {
            inbox,
            slot,
            wake,
            capture: None,
            estimate: Arc::default(),
            edits: Edits::default(),
            progress: Arc::default(),
            checkpoint: None,
            phase: Phase::Idle,
            events: Arc::default(),
            rates: Rates::default(),
            views: Views::default(),
            inserting: Inserting::default(),
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
            priority_until: None,
            regroupings: 0,
            edited: Edited::default(),
            sequence: 0,
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
        Arc::make_mut(&mut self.events).push(Event {
            level,
            message: message.into(),
        });
        self.changed = true;
    }

    /// Gives views more of the solver's time for a while.
    pub fn prioritize_views(&mut self, time: Duration) {
        let end = Instant::now() + time;
        self.priority_until = self.priority_until.max(Some(end));
    }

    /// Marks the state as changed.
    pub fn touch(&mut self) {
        self.changed = true;
    }

    /// Whether nothing of a requested picture is rendered yet.
    pub fn is_asked(&self) -> bool {
        self.views.is_asked() || self.inserting.is_asked()
    }

    /// Whether a requested picture is still missing or has few samples.
    pub fn is_rough(&self) -> bool {
        self.views.is_rough() || self.inserting.is_rough()
    }

    /// Renders a slice of the requested view and one of the composite. Returns whether there is more to render.
    pub fn draw(&mut self) -> bool {
        let Some(capture) = self.capture.clone() else {
            return false;
        };
        let light = Light::new(self.estimate.clone(), self.edited(), &self.settings);
        self.inserting.follow(&light);
        let (drawn, more) = self.views.draw(&capture, &light.edited, &light.options);
        self.changed |= drawn;
        if !self.inserting.is_busy() {
            return more;
        }
        match self.inserting.draw(&capture, &light) {
            Ok(drawn) => self.changed |= drawn,
            Err(error) => self.fail(&error),
        }
        true
    }

    /// Publishes a snapshot if the state has changed: at once if `now`, else at most about 30 times a second.
    pub fn publish(&mut self, now: bool) {
        if !self.changed && !now {
            return;
        }
        if !now && self.published.elapsed() < FRAME {
            return;
        }
        self.changed = false;
        self.published = Instant::now();
        self.sequence += 1;
        self.slot.put(Arc::new(Snapshot {
            sequence: self.sequence,
            phase: self.phase.clone(),
            capture: self.capture.clone(),
            settings: self.settings.clone(),
            progress: self.progress.clone(),
            iterations_per_second: self.rates.iterations(),
            rays_per_second: self.rates.rays(),
            seconds_left: self
                .solving
                .then(|| self.rates.seconds_left(&self.progress, &self.settings))
                .flatten(),
            estimate: self.estimate.clone(),
            edits: self.edits.clone(),
            regroupings: self.regroupings,
            inserted: self.inserted.clone(),
            frame: self.frame,
            continued: self.continued.clone(),
            kept: self.store.kept(),
            view: self.views.shown(),
            insertion: self.inserting.shown(),
            events: self.events.clone(),
        }));
        (self.wake)();
    }
}
