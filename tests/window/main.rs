//! The window's flows, driven by the labels that people see, on a connection that only keeps what it is sent.
#![cfg(feature = "gui")]

mod alignment;
mod connection;
mod flows;
mod grouping;
mod input;
mod light;
mod names;
mod photographs;
mod rendering;
mod sessions;
mod trade;
