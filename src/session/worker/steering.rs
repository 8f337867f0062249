//! Observes a running solver for the worker: carries out commands between iterations, and holds the solver while paused.

use crate::inverse::estimate::Estimate;
use crate::inverse::known::Known;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Checkpoint, Control, Observer, Progress};
use crate::session::command::Command;
use crate::session::inbox::Mail;
use crate::session::slot::FRAME;
use crate::session::worker::state::{Next, Worker};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Time between two checkpoints that are kept in case the solver fails.
const CHECKPOINT: Duration = Duration::from_secs(8);

pub(super) struct Steering<'a> {
    worker: &'a mut Worker,
    recorded: Option<Instant>,
    settings: Settings,
    next: Option<Next>,
    /// Time of the last checkpoint.
    kept: Instant,
    /// Number of commands that were waiting when a checkpoint was offered.
    seen: Option<usize>,
}

impl<'a> Steering<'a> {
    pub fn new(worker: &'a mut Worker) -> Self {
        let settings = worker.state.settings.clone();
        Self {
            worker,
            recorded: None,
            settings,
            next: None,
            kept: Instant::now(),
            seen: None,
        }
    }

    pub fn next(self) -> Next {
        self.next.unwrap_or(Next::Wait)
    }

    /// Copies the solver's progress and estimate: about 30 times a second, and before any command is carried out.
    fn record(&mut self, progress: &Progress, estimate: &Estimate) {
        let worker = &mut *self.worker;
        worker.rates.note(progress);
        let fresh = self.recorded.is_some_and(|at| at.elapsed() < FRAME);
        if fresh && worker.inbox.is_empty() && !worker.paused {
            return;
        }
        self.recorded = Some(Instant::now());
        worker.state.progress = Arc::new(progress.clone());
        worker.state.estimate = Arc::new(estimate.clone());
        worker.touch();
    }

    /// Carries out a command. Returns whether the solve is to end.
    fn carry_out(&mut self, mail: Mail) -> bool {
        let next = match mail {
            Mail::Nothing => None,
            Mail::Closed => Some(Next::Quit),
            Mail::Command(command) => self.worker.handle(command),
        };
        let ends = next.is_some();
        self.next = next;
        ends
    }
}

impl Observer for Steering<'_> {
    fn known(&self) -> Known {
        self.worker.state.edits.known()
    }

    fn observe(&mut self, progress: &Progress, estimate: &Estimate) -> Control {
        self.record(progress, estimate);
        self.worker.keep(false);
        // The checkpoint belongs to this report, so only commands that were waiting when it was made are carried out.
        let mut ready = self.seen.take().unwrap_or(usize::MAX);
        loop {
            // Carry out waiting commands.
            while ready > 0 {
                let mail = self.worker.inbox.poll();
                if matches!(mail, Mail::Nothing) {
                    break;
                }
                if self.carry_out(mail) {
                    return Control::Stop;
                }
                ready -= 1;
            }
            if self.worker.step {
                self.worker.step = false;
                break;
            }
            if !self.worker.paused {
                self.worker.publish(false);
                break;
            }

            // Paused: sleep until a command comes.
            self.worker.publish(true);
            self.worker.keep(false);
            let mail = self.worker.inbox.wait(self.worker.store.rest());
            if self.carry_out(mail) {
                return Control::Stop;
            }
            ready = usize::MAX;
        }
        if self.settings == self.worker.state.settings {
            return Control::Continue;
        }
        self.settings = self.worker.state.settings.clone();
        Control::Change(Box::new(self.settings.clone()))
    }

    /// Takes a checkpoint from time to time, and before a command that may save it.
    fn offer(&mut self, make: &dyn Fn() -> Checkpoint) {
        use Command::{Pause, Save, SolveOn};
        let keeps = |command: &Command| matches!(command, Save(_) | Pause | SolveOn);
        let (waiting, wanted) = self.worker.inbox.look_ahead(keeps);
        self.seen = Some(waiting);
        let wanted = wanted || self.worker.paused;
        if wanted || self.kept.elapsed() >= CHECKPOINT {
            self.worker.checkpoint = Some(make());
            self.worker.store.touch();
            self.kept = Instant::now();
        }
    }
}
