//! Virtual objects in photographs: reading them, placing them, lighting them, and compositing.

pub mod object;
pub mod placement;
pub mod world;
