//! The worker thread: it takes commands, publishes snapshots, saves and resumes. It wakes the window by a callback.

pub mod command;
pub mod edits;
mod full;
pub mod inbox;
pub mod insertion;
pub mod library;
pub mod light;
mod metric;
pub mod open;
pub mod open_capture;
pub mod path_kind;
pub mod photographs;
pub mod rates;
pub mod save;
pub mod slot;
pub mod snapshot;
pub mod store;
pub mod view;
pub mod worker;

pub use worker::Session;
