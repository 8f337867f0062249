//! The window: panes over a session, drawn by egui and wgpu. Talks to the worker through [`worker::Connection`].

pub mod action;
mod controls;
mod document;
mod insertion;
pub mod layout;
pub mod lights;
pub mod model;
mod number;
mod pace;
pub mod panels;
mod panes;
mod perform;
pub mod picture;
pub mod preferences;
mod request;
mod run;
mod selection;
pub mod shell;
mod shown;
pub mod state;
mod task;
mod theme;
mod tool;
pub mod trade;
mod undo;
mod update;
mod view;
pub mod window;
pub mod worker;

pub use run::run;
