//! Turns photographs into observations before the solve: the g-buffer of each photograph, its exposure, and whether the
//! photographs agree with the mesh and with each other.

pub mod alignment;
pub mod calibrated;
pub mod censored;
pub mod exposure;
pub mod gbuffer;
pub mod held_out;
pub mod measured_radiance;
pub mod photographs;
pub mod problem;
pub mod segments;
pub mod sharpness;
