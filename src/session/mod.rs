//! A session: the worker's thread, which takes commands, solves, saves and resumes, and the painter's, which renders
//! pictures. Both publish snapshots and wake the window by a callback.

pub mod command;
pub mod edits;
pub mod inbox;
pub mod insertion;
pub mod library;
pub mod light;
pub mod open;
pub mod open_capture;
pub mod painter;
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
