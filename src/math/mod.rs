//! Colour, frames, matrices, sampling and statistics, independent of any scene.

pub mod blur;
pub mod box_mean;
pub mod cholesky;
pub mod color;
pub mod cumulative;
pub mod frame;
pub mod nullable;
pub mod picture;
pub mod rng;
pub mod sequence;
pub mod sh;
pub mod stats;
pub mod warp;
