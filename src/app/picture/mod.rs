//! Pictures of a view: which there are, how they are looked at, compared, and drawn.

pub(super) mod canvas;
pub mod copy;
pub(super) mod drawn;
pub(super) mod gpu;
pub(super) mod hero;
pub(super) mod inspect;
pub mod look;
pub mod quantity;
pub(super) mod ramp;
pub(super) mod wipe;
