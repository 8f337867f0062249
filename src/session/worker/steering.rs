//! The worker's ear on a running solver: takes commands between iterations, holds the solver while paused.

use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Control, Observer, Progress};
use crate::session::inbox::Mail;
use crate::session::worker::state::{FRAME, Next, Worker};
use std::sync::Arc;
use std::time::Instant;

/// Share of the solver's time that views may take.
const VIEW_SHARE: f32 = 0.15;

/// Observes a solve on behalf of the worker.
pub(super) struct Steering<'a> {
    worker: &'a mut Worker,
    recorded: Option<Instant>,
    settings: Settings,
    next: Option<Next>,
}

impl<'a> Steering<'a> {
    pub fn new(worker: &'a mut Worker) -> Self {
        let settings = worker.settings.clone();
        Self {
            worker,
            recorded: None,
            settings,
            next: None,
        }
    }

    /// What a command asked for after the solve.
    pub fn next(self) -> Next {
        self.next.unwrap_or(Next::Wait)
    }

    /// Keeps a copy of where the solve stands: about 30 times a second, and before any command is carried out.
    fn record(&mut self, progress: &Progress, estimate: &Estimate) {
        let worker = &mut *self.worker;
        worker.rates.note(progress);
        let fresh = self.recorded.is_some_and(|at| at.elapsed() < FRAME);
        if fresh && worker.inbox.is_empty() && !worker.paused {
            return;
        }
        self.recorded = Some(Instant::now());
        worker.progress = Arc::new(progress.clone());
        worker.estimate = Arc::new(estimate.clone());
        worker.touch();
    }

    /// Carries out one piece of mail; whether the solve is to end.
    fn take(&mut self, mail: Mail) -> bool {
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
    fn observe(&mut self, progress: &Progress, estimate: &Estimate) -> Control {
        self.record(progress, estimate);
        loop {
            // Take what waits.
            loop {
                let mail = self.worker.inbox.poll();
                if matches!(mail, Mail::Nothing) {
                    break;
                }
                if self.take(mail) {
                    return Control::Stop;
                }
            }
            if self.worker.step {
                self.worker.step = false;
                break;
            }
            if !self.worker.paused {
                self.worker.draw(VIEW_SHARE);
                self.worker.publish(false);
                break;
            }

            // Held: draw what was asked for, then sleep until a command comes.
            let busy = self.worker.draw(1.0);
            self.worker.publish(!busy);
            if !busy {
                let mail = self.worker.inbox.wait();
                if self.take(mail) {
                    return Control::Stop;
                }
            }
        }
        if self.settings == self.worker.settings {
            return Control::Continue;
        }
        self.settings = self.worker.settings.clone();
        Control::Change(Box::new(self.settings.clone()))
    }
}
