//! From photographs to an estimate: the solvers, what they estimate, and how sure they are.

pub mod cache;
pub mod estimate;
pub mod exposure;
pub mod faces;
pub mod gbuffer;
pub mod held_out;
pub mod known;
pub mod lobe;
pub mod loss;
pub mod measured;
pub mod monitor;
pub mod outside;
pub mod overexposed;
pub mod paper;
pub mod parameters;
pub mod settings;
pub mod sharpness;
pub mod solver;
pub mod texture;
