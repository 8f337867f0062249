//! Holds the newest snapshot. Neither writer nor readers wait.

use crate::session::snapshot::Snapshot;
use std::sync::{Arc, Mutex, PoisonError};

/// The newest snapshot, shared between the worker and its readers.
#[derive(Debug, Default)]
pub struct Slot {
    latest: Mutex<Arc<Snapshot>>,
}

impl Slot {
    /// Replaces the snapshot.
    pub fn put(&self, snapshot: Arc<Snapshot>) {
        *self.latest.lock().unwrap_or_else(PoisonError::into_inner) = snapshot;
    }

    /// The newest snapshot. The lock is only held to copy a pointer.
    pub fn latest(&self) -> Arc<Snapshot> {
        self.latest
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}
