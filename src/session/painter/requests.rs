//! What the painter is to draw. The window and the worker write it, and only the newest of each counts.

use crate::compose::placement::Placement;
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::session::command::{Command, ViewCamera, ViewRequest};
use crate::session::edits::Edits;
use crate::session::open_capture::OpenCapture;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

#[derive(Debug, Default)]
pub struct Requests {
    wanted: Mutex<Wanted>,
    changed: Condvar,
}

/// Everything that decides the pictures.
#[derive(Debug, Clone, Default)]
pub struct Wanted {
    pub capture: Option<Arc<OpenCapture>>,
    /// The estimate, without the edits.
    pub found: Arc<Estimate>,
    pub edits: Edits,
    pub settings: Settings,
    /// Whether a solve is running, which gets most of the processor's time.
    pub solving: bool,
    pub frame: usize,
    pub placements: Vec<Placement>,
    /// Whether objects are left without the blur and grain of their photograph.
    pub exact: bool,
    /// The requested view, if it is new.
    pub view: Option<ViewRequest>,
    /// What else is new since the painter last looked.
    pub new: New,
}

#[derive(Debug, Clone, Copy, Default)]
pub struct New {
    pub capture: bool,
    /// The worker has published another state.
    pub light: bool,
    pub ended: bool,
    pub edits: bool,
    /// The frame, without a view.
    pub frame: bool,
    pub placements: bool,
    pub exact: bool,
    pub quit: bool,
}

impl Wanted {
    /// Whether there is something that a user waits for.
    fn is_urgent(&self) -> bool {
        let new = &self.new;
        let by_hand = new.edits || new.frame || new.placements || new.exact;
        by_hand || new.capture || new.ended || new.quit || self.view.is_some()
    }
}

impl Requests {
    /// Takes what a command of the window changes in the pictures. Returns whether the worker need not get it.
    pub fn take(&self, command: &Command) -> bool {
        match command {
            Command::View(request) => self.change(|wanted| {
                if let ViewCamera::Frame(frame) = request.camera {
                    wanted.frame = frame;
                }
                wanted.view = Some(request.clone());
            }),
            Command::Match(matched) => self.change(|wanted| {
                wanted.new.exact |= wanted.exact == *matched;
                wanted.exact = !matched;
            }),
            Command::Insert(placements) => self.insert(placements.clone()),
            Command::Edit(edits) => self.edit(edits),
            _ => {}
        }
        matches!(command, Command::View(_) | Command::Match(_))
    }

    /// Another capture is open: without edits and objects, at its first frame, or at that of a requested view, which is kept.
    pub fn open(&self, capture: Arc<OpenCapture>) {
        self.change(|wanted| {
            let kept = wanted.view.take().and_then(|view| match view.camera {
                ViewCamera::Frame(frame) => Some((view, frame)),
                ViewCamera::Free(_) => None,
            });
            let (view, frame) = kept.unzip();
            *wanted = Wanted {
                capture: Some(capture),
                settings: wanted.settings.clone(),
                exact: wanted.exact,
                frame: frame.unwrap_or(0),
                view,
                new: New {
                    capture: true,
                    exact: wanted.new.exact,
                    quit: wanted.new.quit,
                    ..New::default()
                },
                ..Wanted::default()
            };
        });
    }

    pub fn edit(&self, edits: &Edits) {
        self.change(|wanted| {
            wanted.new.edits |= wanted.edits != *edits;
            wanted.edits.clone_from(edits);
        });
    }

    pub fn insert(&self, placements: Vec<Placement>) {
        self.change(|wanted| {
            wanted.placements = placements;
            wanted.new.placements = true;
        });
    }

    /// Shows a frame at the size of the one before.
    pub fn show_frame(&self, frame: usize) {
        self.change(|wanted| {
            wanted.frame = frame;
            wanted.new.frame = true;
        });
    }

    /// Sets the estimate, and whether a solve is running.
    pub fn follow(&self, found: &Arc<Estimate>, settings: &Settings, solving: bool) {
        self.change(|wanted| {
            wanted.found.clone_from(found);
            wanted.settings.clone_from(settings);
            wanted.solving = solving;
            wanted.new.light = true;
        });
    }

    /// A solve has ended with the newest estimate.
    pub fn end(&self) {
        self.change(|wanted| wanted.new.ended = true);
    }

    pub fn quit(&self) {
        self.change(|wanted| wanted.new.quit = true);
    }

    /// The frame and the inserted objects.
    pub fn shown(&self) -> (usize, Vec<Placement>) {
        let wanted = self.lock();
        (wanted.frame, wanted.placements.clone())
    }

    /// Keeps only objects that could be placed, unless newer ones are requested.
    pub fn keep(&self, placed: &[Placement]) {
        let mut wanted = self.lock();
        if !wanted.new.placements && !wanted.new.capture {
            wanted.placements = placed.to_vec();
        }
    }

    /// Waits for `rest`, or until there is something new: anything if `idle`, else what a user waits for. Returns what
    /// is wanted.
    pub fn wait(&self, rest: Duration, idle: bool) -> Wanted {
        let waits = |wanted: &mut Wanted| !(wanted.is_urgent() || (idle && wanted.new.light));
        let (mut wanted, _) = self
            .changed
            .wait_timeout_while(self.lock(), rest, waits)
            .unwrap_or_else(PoisonError::into_inner);
        let now = wanted.clone();
        wanted.view = None;
        wanted.new = New::default();
        now
    }

    fn change(&self, change: impl FnOnce(&mut Wanted)) {
        change(&mut self.lock());
        self.changed.notify_all();
    }

    fn lock(&self) -> MutexGuard<'_, Wanted> {
        self.wanted.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
