//! What goes out: insertions, the objects that are inserted, and exported files.

#[path = "../common/beside.rs"]
mod beside;
#[path = "../common/mod.rs"]
mod common;

mod export;
mod insertion;
mod objects;
