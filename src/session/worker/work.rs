//! The worker's main loop: waiting, opening, resuming and solving, with recovery from panics.

use crate::error::{Error, panic_message};
use crate::inverse::solver::{Checkpoint, Termination};
use crate::session::command::{OpenOptions, Regrouping, Source};
use crate::session::edits::Edits;
use crate::session::inbox::Mail;
use crate::session::open_capture::OpenCapture;
use crate::session::snapshot::{Level, Phase};
use crate::session::worker::state::{Begin, Next, Worker};
use crate::session::worker::steering::Steering;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Instant;

impl Worker {
    /// Runs until the command to quit. A panic in a step is reported as an event, and the worker continues.
    pub fn run(mut self, first: Next) {
        let mut next = first;
        loop {
            if matches!(next, Next::Quit) {
                self.keep(true);
                break;
            }
            let step = std::mem::replace(&mut next, Next::Wait);
            match catch_unwind(AssertUnwindSafe(|| self.step(step))) {
                Ok(then) => next = then,
                Err(payload) => self.contain(payload.as_ref()),
            }
        }
    }

    fn step(&mut self, next: Next) -> Next {
        match next {
            Next::Wait => self.wait(),
            Next::Open(source, options, begin) => self.open(&source, &options, begin),
            Next::Resume(folder) => self.resume(&folder),
            Next::Solve(checkpoint) => self.solve(checkpoint.as_ref()),
            Next::Recut(options) => self.recut(&options),
            Next::Reframe(options, go_on) => self.reframe(&options, go_on),
            Next::Regroup(wanted, go_on) => self.regroup(*wanted, go_on),
            Next::Quit => Next::Quit,
        }
    }

    fn contain(&mut self, payload: &(dyn Any + Send)) {
        (self.solving, self.paused, self.step) = (false, false, false);
        self.state.phase = Phase::Failed;
        let problem = format!("internal error: {}", panic_message(payload));
        let remedy = "the last estimate is kept: save it, then reset";
        self.fail(&Error::new("worker", problem, remedy));
    }

    /// Serves commands until there is something else to do.
    fn wait(&mut self) -> Next {
        loop {
            self.publish(true);
            self.keep(false);
            match self.inbox.wait(self.store.rest()) {
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

    fn open(&mut self, source: &Source, options: &OpenOptions, begin: Begin) -> Next {
        self.keep(true);
        self.started = Instant::now();
        let before = std::mem::replace(&mut self.state.phase, Phase::Loading);
        self.publish(true);
        let explicit_settings = std::mem::take(&mut self.explicit_settings);
        match (self.backend.open)(source, options) {
            Ok(capture) => {
                self.seconds_load = self.started.elapsed().as_secs_f64();
                let earlier = match begin {
                    Begin::GoingOn => self.last_session(&capture, explicit_settings),
                    Begin::Anew => None,
                };
                if let Some(earlier) = earlier {
                    return self.go_on_with(earlier, capture);
                }
                let suspect = capture.other_reading().is_some();
                self.store.begin(&capture.hash);
                self.adopt(capture);
                if suspect {
                    self.state.phase = Phase::Paused;
                    return Next::Wait;
                }
                Next::Solve(None)
            }
            Err(error) => {
                self.fail(&error);
                self.recover(before)
            }
        }
    }

    /// After a failure, keeps the previous capture open and continues its solve.
    pub(super) fn recover(&mut self, before: Phase) -> Next {
        self.state.phase = match before {
            Phase::Solving | Phase::Paused if self.checkpoint.is_some() => {
                self.paused = before == Phase::Paused;
                return Next::Solve(self.checkpoint.clone());
            }
            Phase::Solving => Phase::Finished(Termination::Cancelled),
            _ if self.state.capture.is_none() => Phase::Failed,
            before => before,
        };
        Next::Wait
    }

    pub(super) fn adopt(&mut self, capture: OpenCapture) {
        for warning in &capture.warnings {
            self.say(Level::Warning, warning.clone());
        }
        let capture = Arc::new(capture);
        self.requests.open(capture.clone());
        self.state.capture = Some(capture);
        self.state.inserted = Arc::default();
        self.state.continued = None;
        self.state.frame = 0;
        self.inbox.forget_changes();
        self.forget();
        self.state.edits = Edits::default();
    }

    /// Reads the open capture with other options, keeping estimate and edits.
    fn reframe(&mut self, options: &OpenOptions, go_on: bool) -> Next {
        let before = std::mem::replace(&mut self.state.phase, Phase::Loading);
        self.publish(true);
        let kept = (self.state.estimate.clone(), self.state.progress.clone());
        let (checkpoint, edits) = (self.checkpoint.clone(), self.state.edits.clone());
        if self.reopen(options) {
            (self.state.estimate, self.state.progress) = kept;
            self.checkpoint = checkpoint;
            self.set_edits(edits);
        }
        self.state.phase = before;
        self.solve_if(go_on)
    }

    fn solve_if(&self, go_on: bool) -> Next {
        match go_on {
            true => Next::Solve(self.checkpoint.clone()),
            false => Next::Wait,
        }
    }

    /// Reads the open capture with a new segmentation that does not use the held-out pixels, and solves from the start; on failure,
    /// with the old segments.
    fn recut(&mut self, options: &OpenOptions) -> Next {
        self.state.phase = Phase::Loading;
        self.publish(true);
        self.reopen(options);
        Next::Solve(None)
    }

    /// Reads the open capture with other objects, and solves from the start.
    fn regroup(&mut self, wanted: Regrouping, go_on: bool) -> Next {
        let Some(old) = self.state.capture.clone() else {
            return Next::Wait;
        };
        let before = std::mem::replace(&mut self.state.phase, Phase::Loading);
        self.publish(true);
        let options = OpenOptions {
            objects: wanted.changes,
            ..old.options.clone()
        };
        self.state.regroupings += 1;
        self.keep(true);
        if self.reopen(&options) {
            self.store.begin_another();
            self.set_edits(wanted.edits);
            return Next::Solve(None);
        }
        self.state.phase = before;
        self.touch();
        self.solve_if(go_on)
    }

    /// Reads the open capture with other options; inserted objects stay in place. False on failure.
    fn reopen(&mut self, options: &OpenOptions) -> bool {
        let Some(old) = self.state.capture.clone() else {
            return false;
        };
        let capture = match (self.backend.open)(&old.source, options) {
            Ok(capture) => capture,
            Err(error) => {
                self.fail(&error);
                return false;
            }
        };
        let (from, to) = (old.options.coordinates, options.coordinates);
        let (up, new_up) = (old.capture.up, capture.capture.up);
        let (frame, mut inserted) = self.requests.shown();
        for placement in &mut inserted {
            let files = placement.at.map(|at| from.undo(at, up));
            placement.at = files.map(|at| to.apply(at, new_up));
        }
        if capture.hash != old.hash {
            self.store.begin_another();
        }
        self.adopt(capture);
        self.state.frame = frame;
        self.requests.show_frame(frame);
        self.requests.insert(inserted.clone());
        self.state.inserted = Arc::new(inserted);
        self.store.touch();
        true
    }

    fn solve(&mut self, checkpoint: Option<&Checkpoint>) -> Next {
        let Some(capture) = self.state.capture.clone() else {
            return Next::Wait;
        };
        let problem = capture.problem();
        if checkpoint.is_none() {
            self.forget();
        }
        let settings = self.state.settings.clone();
        self.state.phase = match self.paused {
            true => Phase::Paused,
            false => Phase::Solving,
        };
        self.solving = true;
        self.publish(true);

        // The observer borrows the worker, so the solver is moved out for the call.
        let solver = &mut self.backend.solve;
        let mut solver = std::mem::replace(solver, Box::new(crate::inverse::solve));
        let mut steering = Steering::new(self);
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            solver(&problem, &settings, checkpoint, &mut steering)
        }));
        let next = steering.next();
        let held = self.state.phase.clone();
        self.backend.solve = solver;
        (self.solving, self.paused, self.step) = (false, false, false);
        self.touch();
        match outcome {
            Ok(Ok(solution)) => {
                self.state.estimate = Arc::new(capture.marked_doubtful(solution.estimate));
                self.state.progress = Arc::new(solution.progress);
                self.checkpoint = solution.checkpoint;
                // A solve that another command ended is not finished: the session continues with it.
                self.state.phase = match solution.termination {
                    Termination::Cancelled if !matches!(next, Next::Wait) => held,
                    ended => {
                        let (seconds, why) = (self.state.progress.seconds, ended.word());
                        let message = format!("the solve ended after {seconds:.1} s: {why}");
                        self.say(Level::Info, message);
                        Phase::Finished(ended)
                    }
                };
                self.store.touch();
                self.publish(true);
                self.requests.end();
            }
            Ok(Err(error)) => {
                self.state.phase = Phase::Failed;
                self.fail(&error);
            }
            Err(payload) => self.contain(payload.as_ref()),
        }
        next
    }
}
