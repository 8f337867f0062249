//! Pictures of the requested view, drawn a slice at a time between other work.

pub mod hits;
pub mod progressive;
pub mod sized;
mod target;

use crate::inverse::estimate::Estimate;
use crate::session::command::{ViewCamera, ViewRequest};
use crate::session::snapshot::{OpenCapture, View};
use crate::transport::path::PathOptions;
use std::sync::Arc;
use std::time::Instant;
use target::Target;

pub use target::differs;

/// Long side in pixels of the first picture after a camera move.
const FIRST_LONG_SIDE: u32 = 96;
/// Drawing time, in seconds, that may be saved up while the solver is busy.
const MAX_CREDIT: f32 = 0.05;
/// Shortest time between two looks at a changing estimate, in seconds.
const LOOK_AGAIN: f32 = 0.4;

/// Draws the requested view progressively: at once coarse, then sharper.
#[derive(Debug, Default)]
pub struct Views {
    request: Option<ViewRequest>,
    changed: bool,
    target: Option<Target>,
    shown: Option<Arc<View>>,
    sequence: u64,
    credit: f32,
    last: Option<Instant>,
    looked: Option<Instant>,
}

impl Views {
    /// Asks for a view; it replaces the one before.
    pub fn look(&mut self, request: ViewRequest) {
        self.request = Some(request);
        self.changed = true;
    }

    /// The newest pictures.
    pub fn shown(&self) -> Option<Arc<View>> {
        self.shown.clone()
    }

    /// Forgets all pictures, as when another capture is opened; a frame that was asked for is drawn anew.
    pub fn reset(&mut self) {
        let request = self
            .request
            .take()
            .filter(|r| matches!(r.camera, ViewCamera::Frame(_)));
        *self = Self {
            changed: request.is_some(),
            request,
            sequence: self.sequence,
            ..Self::default()
        };
    }

    /// Stops drawing; what was asked for is forgotten.
    pub fn stop(&mut self) {
        *self = Self {
            sequence: self.sequence,
            ..Self::default()
        };
    }

    /// Draws the requested view anew, coarsely at once, as when the light was changed by hand.
    pub fn look_again(&mut self) {
        self.changed = self.request.is_some();
    }

    /// Starts the render over with an estimate that is final.
    pub fn refresh(&mut self, estimate: &Arc<Estimate>) {
        if let Some(target) = &mut self.target {
            target.start_over(estimate);
        }
    }

    /// Draws for a moment, taking at most about `fraction` of the time since the last call, but a new request at once.
    /// Returns whether the pictures changed, and whether there is more to draw.
    pub fn draw(
        &mut self,
        capture: &OpenCapture,
        estimate: &Arc<Estimate>,
        options: &PathOptions,
        fraction: f32,
    ) -> (bool, bool) {
        let now = Instant::now();
        let elapsed = self
            .last
            .replace(now)
            .map_or(0.0, |last| (now - last).as_secs_f32());
        self.credit = (self.credit + fraction * elapsed).min(MAX_CREDIT);
        if self.changed {
            self.changed = false;
            let request = self.request.as_ref();
            self.target = request.and_then(|r| Target::new(capture, estimate, r, FIRST_LONG_SIDE));
            self.looked = Some(now);
            let drawn = self.sharpen(options);
            return (drawn, self.target.is_some());
        }
        if fraction < 1.0 && self.credit <= 0.0 {
            return (false, self.target.is_some());
        }
        self.follow(estimate, now);
        let drawn = self.sharpen(options);
        self.credit -= now.elapsed().as_secs_f32();
        let more = self.target.as_ref().is_some_and(|t| !t.is_done());
        (drawn, more)
    }

    /// Takes up a newer estimate, where it differs to the eye and the last one had its time.
    fn follow(&mut self, estimate: &Arc<Estimate>, now: Instant) {
        let rested = self
            .looked
            .is_none_or(|at| (now - at).as_secs_f32() >= LOOK_AGAIN);
        if let Some(target) = self.target.as_mut().filter(|_| rested) {
            self.looked = Some(now);
            target.follow(estimate);
        }
    }

    /// Whether the first complete picture of the requested view is still to come.
    pub fn is_rough(&self) -> bool {
        self.target.as_ref().is_some_and(Target::is_rough)
    }

    fn sharpen(&mut self, options: &PathOptions) -> bool {
        let Some(target) = &mut self.target else {
            return false;
        };
        let Some(view) = target.sharpen(options, self.sequence + 1) else {
            return false;
        };
        self.sequence += 1;
        self.shown = Some(Arc::new(view));
        true
    }
}
