//! Virtual objects in photographs: loading, placement, lighting and compositing.

pub mod backdrop;
pub mod denoise;
pub mod first_look;
pub mod insert;
pub mod matte;
pub mod naive;
pub mod object;
pub mod pick;
pub mod placement;
pub mod psf_and_grain;
pub mod relight;
pub mod world;
pub mod write;
