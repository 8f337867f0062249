//! README's figures of the captures and of the built-in room, and the experiments in their quick form.

#[path = "../common/beside.rs"]
mod beside;

mod results;
mod studies;
mod trade;
