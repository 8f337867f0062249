//! Whole solves of small rooms whose truth is known, the families of generated rooms, and what a solve leaves to go on from.

#[path = "../common/beside.rs"]
mod beside;
#[path = "../common/mod.rs"]
mod common;
#[path = "../scenes/mod.rs"]
mod scenes;

mod checkpoints;
mod families;
mod known;
mod lobes;
mod outside;
mod paper;
mod paper_failures;
mod readings;
mod resume;
mod saturated;
mod solvers;
mod textures;
