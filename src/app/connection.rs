//! What the window needs of the worker: a way to ask, and the newest answer.

use crate::session::command::Command;
use crate::session::snapshot::Snapshot;
use std::sync::Arc;

/// The window's end of a session. Neither method ever waits.
pub trait Connection {
    /// Hands a command to the worker; false where its queue is full, to be tried again.
    fn send(&self, command: Command) -> bool;

    /// The newest snapshot.
    fn latest(&self) -> Arc<Snapshot>;
}

impl Connection for crate::session::Session {
    fn send(&self, command: Command) -> bool {
        Self::send(self, command)
    }

    fn latest(&self) -> Arc<Snapshot> {
        Self::latest(self)
    }
}
