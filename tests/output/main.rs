//! What goes out: photographs with objects in them or in other light, and exported files.

#[path = "../common/beside.rs"]
mod beside;
#[path = "../common/mod.rs"]
mod common;

mod export;
mod insertion;
mod objects;
mod photographs;
