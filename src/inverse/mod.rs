//! From photographs to an estimate: the solvers, what they estimate, and how sure they are.

pub mod estimate;
pub mod settings;
pub mod solver;
