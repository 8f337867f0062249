//! The worker thread: commands in, snapshots out, save and resume. Knows no window; wakes it by a callback.

pub mod command;
pub mod snapshot;
