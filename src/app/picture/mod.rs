//! Pictures of a view: which there are, how they are looked at, compared, and drawn.

pub mod canvas;
pub mod copy;
pub mod drawn;
pub mod gpu;
pub mod hero;
pub mod inspect;
pub mod look;
pub mod quantity;
pub mod ramp;
pub mod wipe;
