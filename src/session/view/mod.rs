//! Pictures of the requested view, rendered in slices between other work.

pub mod hits;
pub mod progressive;
pub mod sized;
mod target;

use crate::inverse::estimate::Estimate;
use crate::render::Renderer;
use crate::session::command::{ViewCamera, ViewRequest};
use crate::session::open_capture::OpenCapture;
use crate::session::snapshot::View;
use crate::transport::path::PathOptions;
use std::sync::Arc;
use std::time::Instant;
use target::Target;

pub use target::{difference, differs};

/// Long side in pixels of the first picture after a camera move.
const FIRST_LONG_SIDE: u32 = 96;
/// Shortest time between two checks for a changed estimate, in seconds.
const CHECK_INTERVAL: f32 = 0.4;

/// Renders the requested view progressively.
#[derive(Debug, Default)]
pub struct Views {
    request: Option<ViewRequest>,
    changed: bool,
    target: Option<Target>,
    shown: Option<Arc<View>>,
    sequence: u64,
    checked: Option<Instant>,
}

impl Views {
    /// Requests a view; replaces the previous request.
    pub fn request(&mut self, request: ViewRequest) {
        self.request = Some(request);
        self.changed = true;
    }

    pub fn shown(&self) -> Option<Arc<View>> {
        self.shown.clone()
    }

    /// Drops all pictures when another capture is opened. A request for a frame is kept.
    pub fn reset(&mut self) {
        let is_frame = |r: &ViewRequest| matches!(r.camera, ViewCamera::Frame(_));
        let request = self.request.take().filter(is_frame);
        self.stop();
        (self.changed, self.request) = (request.is_some(), request);
    }

    pub fn stop(&mut self) {
        *self = Self {
            sequence: self.sequence,
            ..Self::default()
        };
    }

    /// Renders the requested view again from a coarse picture, after the light was edited.
    pub fn redraw(&mut self) {
        self.changed = self.request.is_some();
    }

    /// Restarts the render with a final estimate.
    pub fn refresh(&mut self, estimate: &Arc<Estimate>) {
        if let Some(target) = &mut self.target {
            target.start_over(estimate);
        }
    }

    /// Renders a slice. Returns whether the pictures changed, and whether there is more to render.
    pub fn draw(
        &mut self,
        capture: &OpenCapture,
        estimate: &Arc<Estimate>,
        renderer: &Renderer,
        options: &PathOptions,
    ) -> (bool, bool) {
        let now = Instant::now();
        if std::mem::take(&mut self.changed) {
            let request = self.request.as_ref();
            self.target = request.and_then(|r| Target::new(capture, estimate, r, FIRST_LONG_SIDE));
            self.checked = Some(now);
        } else {
            self.follow(estimate, now);
        }
        let (target, sequence) = (self.target.as_mut(), self.sequence + 1);
        let view = target.and_then(|target| target.sharpen(renderer, options, sequence));
        let drawn = view.is_some();
        if let Some(view) = view {
            (self.sequence, self.shown) = (sequence, Some(Arc::new(view)));
        }
        let more = self.target.as_ref().is_some_and(|t| !t.is_done());
        (drawn, more)
    }

    /// Switches to a new estimate if it is visibly different and the last one has been shown for long enough.
    fn follow(&mut self, estimate: &Arc<Estimate>, now: Instant) {
        let is_old = |at: Instant| (now - at).as_secs_f32() >= CHECK_INTERVAL;
        let rested = self.checked.is_none_or(is_old);
        if let Some(target) = self.target.as_mut().filter(|_| rested) {
            self.checked = Some(now);
            target.follow(estimate);
        }
    }

    /// Whether the first complete picture of the requested view is still missing.
    pub fn is_rough(&self) -> bool {
        self.target.as_ref().is_some_and(Target::is_rough)
    }
}
