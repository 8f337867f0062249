//! What the worker holds, and its main loop.

use crate::error::Error;
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Checkpoint, Problem, Progress};
use crate::session::command::{OpenOptions, Source};
use crate::session::inbox::{Inbox, Mail};
use crate::session::insertion::Inserting;
use crate::session::light::path_options;
use crate::session::rates::Rates;
use crate::session::save;
use crate::session::slot::Slot;
use crate::session::snapshot::{Event, Level, OpenCapture, Phase, Snapshot};
use crate::session::view::Views;
use crate::session::worker::steering::Steering;
use crate::session::worker::{Backend, Wake};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Shortest time between two snapshots while nothing else asks for one.
pub(super) const FRAME: Duration = Duration::from_millis(33);

/// What the worker does next.
pub(super) enum Next {
    /// Serve commands.
    Wait,
    /// Read a capture, then solve it.
    Open(Source),
    /// Read what an earlier run wrote, then go on from it.
    Resume(PathBuf),
    /// Solve what is open, from the start or from a checkpoint.
    Solve(Option<Checkpoint>),
    /// End.
    Quit,
}

/// Everything the worker owns.
pub(super) struct Worker {
    pub inbox: Inbox,
    pub slot: Arc<Slot>,
    pub wake: Wake,
    pub backend: Backend,
    pub settings: Settings,
    pub capture: Option<Arc<OpenCapture>>,
    pub estimate: Arc<Estimate>,
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
            backend,
            settings,
            capture: None,
            estimate: Arc::default(),
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
            sequence: 0,
            changed: true,
            published: Instant::now(),
        }
    }

    /// Works until told to quit. A panic in any step becomes an event, and the worker goes on answering.
    pub fn run(mut self, first: Next) {
        let mut next = first;
        loop {
            if matches!(next, Next::Quit) {
                break;
            }
            let step = std::mem::replace(&mut next, Next::Wait);
            match catch_unwind(AssertUnwindSafe(|| self.take(step))) {
                Ok(then) => next = then,
                Err(payload) => self.contain(payload.as_ref()),
            }
        }
    }

    fn take(&mut self, next: Next) -> Next {
        match next {
            Next::Wait => self.wait(),
            Next::Open(source) => self.open(&source, &OpenOptions::default()),
            Next::Resume(folder) => self.resume(&folder),
            Next::Solve(checkpoint) => self.solve(checkpoint.as_ref()),
            Next::Quit => Next::Quit,
        }
    }

    /// Keeps the last estimate after a panic and says what happened.
    fn contain(&mut self, payload: &(dyn Any + Send)) {
        let message = payload
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| payload.downcast_ref::<&str>().copied())
            .unwrap_or("no message");
        self.solving = false;
        self.paused = false;
        self.step = false;
        self.views.stop();
        self.inserting.reset();
        self.phase = Phase::Failed;
        self.fail(&Error::new(
            "worker",
            format!("internal error: {message}"),
            "the last estimate is kept: save it, then reset",
        ));
    }

    /// Serves commands and views until there is something else to do.
    fn wait(&mut self) -> Next {
        loop {
            let busy = self.draw(1.0);
            self.publish(!busy);
            let mail = if busy {
                self.inbox.poll()
            } else {
                self.inbox.wait()
            };
            match mail {
                Mail::Nothing => {}
                Mail::Closed => return Next::Quit,
                Mail::Command(command) => {
                    if let Some(next) = self.handle(command) {
                        return next;
                    }
                }
            }
        }
    }

    fn open(&mut self, source: &Source, options: &OpenOptions) -> Next {
        self.started = Instant::now();
        let before = std::mem::replace(&mut self.phase, Phase::Loading);
        self.publish(true);
        match (self.backend.open)(source, options) {
            Ok(capture) => {
                self.seconds_load = self.started.elapsed().as_secs_f64();
                self.adopt(capture);
                Next::Solve(None)
            }
            // What was open stays open.
            Err(error) => {
                self.phase = if self.capture.is_some() {
                    before
                } else {
                    Phase::Failed
                };
                self.fail(&error);
                Next::Wait
            }
        }
    }

    fn adopt(&mut self, capture: OpenCapture) {
        for warning in &capture.warnings {
            self.say(Level::Warning, warning.clone());
        }
        self.capture = Some(Arc::new(capture));
        self.forget();
        self.views.reset();
        self.inserting.reset();
    }

    /// Forgets the estimate and everything that led to it.
    pub fn forget(&mut self) {
        self.estimate = Arc::default();
        self.progress = Arc::default();
        self.checkpoint = None;
        self.rates = Rates::default();
    }

    fn resume(&mut self, folder: &std::path::Path) -> Next {
        let before = std::mem::replace(&mut self.phase, Phase::Loading);
        self.publish(true);
        let loaded = save::load(folder).and_then(|saved| {
            let capture = (self.backend.open)(&saved.source, &saved.options)?;
            let estimate = saved.estimate_for(&capture)?;
            Ok((capture, estimate, saved))
        });
        match loaded {
            Ok((capture, estimate, saved)) => {
                self.adopt(capture);
                self.estimate = Arc::new(estimate);
                self.settings = saved.settings;
                match saved.checkpoint {
                    Some(checkpoint) => Next::Solve(Some(checkpoint)),
                    None => {
                        self.phase = Phase::Finished(saved.termination);
                        Next::Wait
                    }
                }
            }
            Err(error) => {
                self.phase = before;
                self.fail(&error);
                Next::Wait
            }
        }
    }

    fn solve(&mut self, checkpoint: Option<&Checkpoint>) -> Next {
        let Some(capture) = self.capture.clone() else {
            return Next::Wait;
        };
        let problem = Problem {
            scene: capture.scene.clone(),
            photographs: capture.photographs.clone(),
        };
        if checkpoint.is_none() {
            self.forget();
        }
        let settings = self.settings.clone();
        self.phase = if self.paused {
            Phase::Paused
        } else {
            Phase::Solving
        };
        self.solving = true;
        self.publish(true);

        // The solver is moved out for the call, because the observer borrows the worker.
        let mut solver = std::mem::replace(
            &mut self.backend.solve,
            Box::new(crate::inverse::solver::solve),
        );
        let mut steering = Steering::new(self);
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            solver(&problem, &settings, checkpoint, &mut steering)
        }));
        let next = steering.next();
        self.backend.solve = solver;
        self.solving = false;
        self.paused = false;
        self.step = false;
        self.changed = true;
        match outcome {
            Ok(Ok(solution)) => {
                self.estimate = Arc::new(solution.estimate);
                self.progress = Arc::new(solution.progress);
                self.checkpoint = solution.checkpoint;
                self.phase = Phase::Finished(solution.termination);
                self.views.refresh(&self.estimate);
                self.inserting.update();
            }
            Ok(Err(error)) => {
                self.phase = Phase::Failed;
                self.fail(&error);
            }
            Err(payload) => self.contain(payload.as_ref()),
        }
        next
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

    /// Marks the state as worth a new snapshot.
    pub fn touch(&mut self) {
        self.changed = true;
    }

    /// Draws a slice of the requested view, taking at most about `share` of the time; whether there is more to draw.
    pub fn draw(&mut self, share: f32) -> bool {
        let Some(capture) = self.capture.clone() else {
            return false;
        };
        let options = path_options(&self.settings);
        let (drawn, more) = self.views.draw(&capture, &self.estimate, &options, share);
        self.changed |= drawn;
        if self.estimate.objects.is_empty() || !self.inserting.is_busy() {
            return more;
        }
        match self
            .inserting
            .draw(&capture, &self.estimate, &options, share)
        {
            Ok(drawn) => self.changed |= drawn,
            Err(error) => self.fail(&error),
        }
        true
    }

    /// Hands out a snapshot if something changed: at once if `now`, else at most about 30 times a second.
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
            view: self.views.shown(),
            insertion: self.inserting.shown(),
            events: self.events.clone(),
        }));
        (self.wake)();
    }
}
