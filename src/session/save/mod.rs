//! Results of a solve: writing them into a folder, and loading them.

pub mod estimate;
pub mod maps;
pub mod memory;
pub mod named;
pub mod pictures;
pub mod report;
mod results;
mod saved;
pub mod staging;
mod write;

pub use crate::export::overwrite::{CHECKPOINT, ESTIMATE, REPORT};
pub use results::Results;
pub use saved::{Saved, load, load_checkpoint};
pub use write::{write, write_checkpoint, write_edited};
