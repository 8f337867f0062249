//! A session: the worker's thread, which takes commands, solves, saves and resumes, and the painter's, which renders
//! pictures. Both publish snapshots and wake the window by a callback.

pub mod command;
pub mod edits;
pub(crate) mod inbox;
pub mod insertion;
pub(crate) mod library;
pub mod light;
pub mod open;
pub(crate) mod open_capture;
pub(crate) mod painter;
pub mod photographs;
pub(crate) mod rates;
pub mod save;
pub(crate) mod slot;
pub mod snapshot;
pub mod store;
pub(crate) mod view;
pub mod worker;

pub use worker::Session;
