//! Where the newest snapshot lies: whoever looks finds the latest, and nobody waits.

use crate::session::snapshot::Snapshot;
use std::sync::{Arc, Mutex, PoisonError};

/// A latest-wins slot between the worker and those who look at it.
#[derive(Debug, Default)]
pub struct Slot {
    latest: Mutex<Arc<Snapshot>>,
}

impl Slot {
    /// Replaces the snapshot.
    pub fn put(&self, snapshot: Arc<Snapshot>) {
        *self.latest.lock().unwrap_or_else(PoisonError::into_inner) = snapshot;
    }

    /// The newest snapshot. The lock is held for the copy of one pointer only.
    pub fn latest(&self) -> Arc<Snapshot> {
        self.latest
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}
