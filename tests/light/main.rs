//! Rays, light and derivatives against closed forms, finite differences and other programs.

#[path = "../common/beside.rs"]
mod beside;
#[path = "../scenes/mod.rs"]
mod scenes;

mod gradients;
mod hierarchy;
mod light_layers;
mod paper_reference;
mod path_cache;
mod room;
mod transport;
