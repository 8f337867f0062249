//! Pictures of a view: which there are, how they are looked at, compared, and drawn.

pub mod canvas;
pub mod compare;
pub mod copy;
pub mod drawn;
pub mod gpu;
pub mod hero;
pub mod inspect;
pub mod irradiance;
pub mod look;
pub mod needed;
pub mod quantity;
pub mod ramp;
pub mod wipe;
