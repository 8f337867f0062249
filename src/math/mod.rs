//! Colour, frames, sampling, statistics: what light transport is written in. Knows nothing of scenes.

pub mod color;
pub mod frame;
pub mod nullable;
pub mod picture;
pub mod rng;
pub mod sequence;
pub mod sh;
pub mod stats;
pub mod warp;
