//! The built-in room: geometry, lights and materials, photographs and ground truth. Also rooms generated at random.
//!
//! All but the photographs is computed at start-up. They are path-traced renderings of the room, stored in
//! `assets/room` so that the program starts at once; `relit demo --seed` renders them again.

pub mod build;
pub mod cameras;
mod furniture;
pub mod generated;
mod model;
pub mod photographs;
pub mod shape;
mod texture;
pub mod truth;
mod write;

pub use model::{Room, linear_photograph};
pub use write::write;

use crate::capture::Capture;
use crate::error::Result;

/// The built-in room as a capture, ready to solve.
///
/// # Errors
/// The program file is damaged.
pub fn capture() -> Result<Capture> {
    Ok(Room::new().capture_of(photographs::stored()?, photographs::STORED.size))
}
