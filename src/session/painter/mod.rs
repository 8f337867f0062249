//! The painter: a thread that renders the requested view and its composite while the worker solves.

mod requests;

use crate::error::{Error, Result, panic_message};
use crate::render::Renderer;
use crate::session::edits::Edited;
use crate::session::insertion::Inserting;
use crate::session::light::Light;
use crate::session::open_capture::OpenCapture;
use crate::session::slot::{FRAME, Pictures, Slot};
use crate::session::snapshot::Level;
use crate::session::view::Views;
use crate::session::worker::Wake;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::{Duration, Instant};

pub use requests::{Requests, Wanted};

/// How long pictures get as much of the processor's time as a solve after a new view is requested, ...
const VIEW_PRIORITY: Duration = Duration::from_secs(2);
/// ... and after a change of lamps, materials or inserted objects, whose result the user is waiting for.
const CHANGE_PRIORITY: Duration = Duration::from_secs(15);
/// Fraction of the time in which pictures are rendered beside a solve otherwise, once the first is complete.
const FRACTION: f32 = 0.03;
/// Longest rest between two slices beside a solve.
const MAX_REST: Duration = Duration::from_secs(4);
/// How often a painter with nothing to do compares its pictures with the estimate.
const IDLE_REST: Duration = Duration::from_secs(1);

pub struct Painter {
    requests: Arc<Requests>,
    slot: Arc<Slot>,
    wake: Wake,
    /// Threads of its own: the solver's work would make it wait for a whole stage.
    threads: ThreadPool,
    renderer: Renderer,
    capture: Option<Arc<OpenCapture>>,
    views: Views,
    inserting: Inserting,
    edited: Edited,
    /// Until when pictures get half of the processor's time.
    priority_until: Option<Instant>,
    /// Whether the pictures differ from the published ones, and when those were published.
    changed: bool,
    published: Option<Instant>,
}

impl Painter {
    pub fn new(
        requests: Arc<Requests>,
        slot: Arc<Slot>,
        wake: Wake,
        renderer: Renderer,
    ) -> Result<Self> {
        let threads = ThreadPoolBuilder::new()
            .num_threads(rayon::current_num_threads())
            .thread_name(|index| format!("relit-painter-{index}"));
        let threads = threads.build().map_err(|error| {
            let remedy = "close other programs and start again";
            Error::new("painter threads", error, remedy)
        })?;
        Ok(Self {
            requests,
            slot,
            wake,
            threads,
            renderer,
            capture: None,
            views: Views::default(),
            inserting: Inserting::default(),
            edited: Edited::default(),
            priority_until: None,
            changed: false,
            published: None,
        })
    }

    /// Paints until the command to quit. A panic is reported as an event, and the pictures start over.
    pub fn run(mut self) {
        let (mut rest, mut idle) = (IDLE_REST, true);
        loop {
            let wanted = self.requests.wait(rest, idle);
            if wanted.new.quit {
                return;
            }
            let started = Instant::now();
            let busy = match catch_unwind(AssertUnwindSafe(|| self.paint(&wanted))) {
                Ok(busy) => busy,
                Err(payload) => {
                    self.views.stop();
                    self.inserting.reset();
                    let message = panic_message(payload.as_ref());
                    self.fail(format!("pictures: internal error: {message}"));
                    false
                }
            };
            for warning in self.renderer.take_warnings() {
                self.slot.say(Level::Warning, warning);
                self.changed = true;
            }
            idle = !busy;
            self.publish(idle);
            rest = match (busy, wanted.solving) {
                (false, _) => IDLE_REST,
                (true, true) if !self.is_waited_for() => {
                    (started.elapsed().mul_f32(1.0 / FRACTION - 1.0)).min(MAX_REST)
                }
                _ => Duration::ZERO,
            };
        }
    }

    /// Takes what is new and renders a slice. Returns whether there is more to render.
    fn paint(&mut self, wanted: &Wanted) -> bool {
        self.take(wanted);
        let Some(capture) = self.capture.clone() else {
            return false;
        };
        let edited = self.edited.of(&wanted.found, &wanted.edits);
        if wanted.new.ended {
            self.views.refresh(&edited);
        }
        let light = Light::new(wanted.found.clone(), edited, &wanted.settings);
        self.inserting.follow(&light);
        let (views, inserting) = (&mut self.views, &mut self.inserting);
        let renderer = &self.renderer;
        // The composite that a user waits for comes before the re-render, which few look at then.
        let mut more = true;
        if !inserting.is_rough() || views.shown().is_none() {
            let (edited, options) = (&light.edited, &light.options);
            let drawn = (self.threads).install(|| views.draw(&capture, edited, renderer, options));
            (self.changed, more) = (self.changed | drawn.0, drawn.1);
        }
        if !inserting.is_busy() {
            return more;
        }
        match self
            .threads
            .install(|| inserting.draw(renderer, &capture, &light))
        {
            Ok(drawn) => self.changed |= drawn,
            Err(error) => {
                self.requests.keep(self.inserting.placements());
                self.fail(error.to_string());
            }
        }
        true
    }

    fn take(&mut self, wanted: &Wanted) {
        let new = wanted.new;
        if new.capture {
            self.capture.clone_from(&wanted.capture);
            self.views.reset();
            self.inserting.reset();
            self.changed = true;
        }
        if new.frame || new.capture {
            self.inserting.show_frame(wanted.frame);
        }
        if let Some(request) = &wanted.view {
            self.prioritize(VIEW_PRIORITY);
            self.inserting.show(wanted.frame, request.composite);
            self.views.request(request.clone());
        }
        if new.exact {
            self.inserting.match_photograph(!wanted.exact);
        }
        if new.placements {
            self.prioritize(CHANGE_PRIORITY);
            self.inserting.place(wanted.placements.clone());
        }
        if new.edits {
            self.prioritize(CHANGE_PRIORITY);
            self.views.redraw();
            self.inserting.update();
        }
    }

    /// Gives pictures as much of the processor's time as a solve for a while.
    fn prioritize(&mut self, time: Duration) {
        let end = Instant::now() + time;
        self.priority_until = self.priority_until.max(Some(end));
    }

    /// Whether a user waits for pictures: they were requested a short time ago, or the first are not complete.
    fn is_waited_for(&self) -> bool {
        self.priority_until.is_some_and(|end| Instant::now() < end)
            || self.views.is_rough()
            || self.inserting.is_rough()
    }

    fn fail(&mut self, message: String) {
        self.slot.say(Level::Error, message);
        self.changed = true;
    }

    /// Publishes changed pictures: at once if `now`, else at most about 30 times a second.
    fn publish(&mut self, now: bool) {
        let early = self.published.is_some_and(|at| at.elapsed() < FRAME);
        if !self.changed || (early && !now) {
            return;
        }
        self.changed = false;
        self.published = Some(Instant::now());
        self.slot.put_pictures(Pictures {
            capture: self.capture.clone(),
            view: self.views.shown(),
            insertion: self.inserting.shown(),
        });
        (self.wake)();
    }
}
