//! relit: lights and materials of a scanned room from its photographs, by inverse path tracing.
//!
//! Layers, each importing only from those below it (checked by `tests/layers.rs`):
//!
//! ```text
//! app   (egui window)          cli   (commands, progress bars)
//!   └──────────┬─────────────────┘
//!          session    worker thread, commands in, snapshots out, save and resume
//! study      │
//!   └────┬───┴──────────┬─────────────┬────────┐
//!     inverse        compose        export    room
//!   estimate,       insertion,     glb, obj, built-in
//!   solvers         naive SH       exr, plots  capture
//!        └─────┬────────┘
//!        calibrate      whether photographs agree with the mesh
//!            │
//!         render         who traces pictures: the graphics card or the processor
//!            ├── gpu       the path tracer as compute shaders
//!        transport      paths: sampling, bsdf, emitters, NEE + MIS
//!            │
//!          scene        mesh, objects, hierarchy, cameras
//!            ├── capture   readers: obj, ply, glb, transforms.json, images
//!          math         colour, frames, statistics
//!            │
//!       error, say       failures with their remedies; what is said on the terminal
//! ```

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
