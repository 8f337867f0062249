//! The window: panes over a session, drawn by egui and wgpu. Talks to the worker through [`connection::Connection`].

pub mod action;
pub mod batch;
pub mod connection;
pub mod describe;
pub mod document;
pub mod grouping;
pub mod insertion;
pub mod layout;
pub mod lights;
pub mod model;
pub mod opening;
pub mod pace;
pub mod panels;
mod perform;
pub mod pick;
pub mod picture;
pub mod preferences;
mod run;
pub mod shell;
pub mod size;
pub mod state;
pub mod task;
pub mod theme;
pub mod trade;
pub mod undo;
pub mod window;

pub use run::run;
