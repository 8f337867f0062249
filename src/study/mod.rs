//! Measurements on finished work: errors against the truth, error over time, and the paper's experiments.

mod albedo_pictures;
mod emission;
pub mod evaluate;
pub mod experiments;
pub mod families;
pub mod machine;
mod subject;
pub mod trade;
