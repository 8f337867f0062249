//! The window: panes over a session, drawn by egui and wgpu. Talks to the worker through [`worker::Connection`].

pub mod action;
pub mod controls;
pub mod document;
pub mod insertion;
pub mod jobs;
pub mod layout;
pub mod lights;
pub mod model;
pub mod number;
pub mod pace;
pub mod panels;
mod panes;
mod perform;
pub mod picture;
pub mod preferences;
pub mod request;
mod run;
pub mod selection;
pub mod shell;
pub mod shown;
pub mod state;
pub mod task;
pub mod theme;
pub mod tool;
pub mod trade;
pub mod undo;
mod update;
pub mod view;
pub mod window;
pub mod worker;

pub use run::run;
