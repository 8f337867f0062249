//! Results of a solve: writing them into a folder, and loading them.

pub(crate) mod estimate;
pub mod maps;
pub(crate) mod memory;
pub(crate) mod named;
pub mod pictures;
pub(crate) mod report;
mod results;
pub(crate) mod staging;
mod write;

pub use crate::export::overwrite::{CHECKPOINT, ESTIMATE, REPORT};
pub use results::{Results, Saved, load, load_checkpoint};
pub(crate) use write::write_edited;
pub use write::{write, write_checkpoint};
