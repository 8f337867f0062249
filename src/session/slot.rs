//! Holds the newest snapshot: the worker's state with the painter's pictures. Neither writers nor readers wait.

use crate::session::open_capture::OpenCapture;
use crate::session::snapshot::{Event, Insertion, Level, Snapshot, View};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Shortest time between two snapshots of one writer, unless one is needed at once.
pub const FRAME: Duration = Duration::from_millis(33);

/// The newest snapshot, shared between worker, painter and readers.
#[derive(Debug, Default)]
pub struct Slot {
    parts: Mutex<Parts>,
}

#[derive(Debug, Default)]
struct Parts {
    snapshot: Arc<Snapshot>,
    pictures: Pictures,
    events: Arc<Vec<Event>>,
}

/// The painter's pictures.
#[derive(Debug, Clone, Default)]
pub struct Pictures {
    pub capture: Option<Arc<OpenCapture>>,
    pub view: Option<Arc<View>>,
    pub insertion: Option<Arc<Insertion>>,
}

impl Slot {
    /// Replaces the worker's state. Sequence, pictures and events of `state` are not used.
    pub fn put(&self, state: Snapshot) {
        self.lock().compose(state);
    }

    /// Replaces the pictures. They are shown while their capture is the open one.
    pub fn put_pictures(&self, pictures: Pictures) {
        let mut parts = self.lock();
        parts.pictures = pictures;
        let state = parts.snapshot.as_ref().clone();
        parts.compose(state);
    }

    /// Adds an event, which the next snapshot holds.
    pub fn say(&self, level: Level, message: String) {
        Arc::make_mut(&mut self.lock().events).push(Event { level, message });
    }

    pub fn pictures(&self) -> Pictures {
        self.lock().pictures.clone()
    }

    /// The newest snapshot. The lock is only held to copy pointers.
    pub fn latest(&self) -> Arc<Snapshot> {
        self.lock().snapshot.clone()
    }

    fn lock(&self) -> MutexGuard<'_, Parts> {
        self.parts.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Parts {
    fn compose(&mut self, state: Snapshot) {
        let pictures = match (&state.capture, &self.pictures.capture) {
            (Some(open), Some(shown)) if Arc::ptr_eq(open, shown) => self.pictures.clone(),
            _ => Pictures::default(),
        };
        self.snapshot = Arc::new(Snapshot {
            sequence: self.snapshot.sequence + 1,
            view: pictures.view,
            insertion: pictures.insertion,
            events: self.events.clone(),
            ..state
        });
    }
}
