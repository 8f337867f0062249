//! relit: lights and materials of a scanned room from its photographs, by inverse path tracing.
//!
//! Layers, each importing only from those below it (checked by `tests/layers.rs`):
//!
//! ```text
//! app   (egui window)            cli   (commands, progress bars)
//!   └────────────┬─────────────────┘
//!             session     worker thread, commands in, snapshots out, save and resume
//!               │
//!             study       experiments of the paper, the trade of speed for accuracy, families of rooms
//!      ┌────────┼──────────┬─────────────┐
//!   inverse  compose    export         room      solvers; inserted objects; files for others; built-in and generated rooms
//!      │
//!   calibrate             photographs → observations: g-buffer, exposures, outlier frames, checks of poses
//!      └────────┬──────────┘
//!            render       who traces pictures: the graphics card (gpu) or the processor (transport)
//!               │
//!           transport     path tracer: sampling, bsdf, emitters, environment
//!               │
//!             scene       mesh, objects, hierarchy, cameras
//!               │
//!            capture      readers, importers, fusion of depth images, segmentation
//!               │
//!             math        colour, frames, statistics, random numbers
//!               │
//!          error, say     failures with their remedies; what is said on the terminal
//! ```
//!
//! `inverse` in turn: [`inverse::pipeline`] and [`inverse::paper`] are the two solvers, over [`inverse::fit`] (least squares and
//! standard errors) and [`inverse::paths`] (stored paths and their derivatives).

// What is printed goes through `say`, which a closed pipe does not stop.
#![cfg_attr(not(test), warn(clippy::print_stdout, clippy::print_stderr))]

#[cfg(feature = "gui")]
pub mod app;
pub mod calibrate;
pub mod capture;
pub mod cli;
pub mod compose;
pub mod error;
pub mod export;
pub mod gpu;
pub mod inverse;
pub mod math;
pub mod render;
pub mod room;
pub mod say;
pub mod scene;
pub mod session;
pub mod study;
pub mod transport;
