//! Measurements on finished work: how far an estimate is from the truth, and what exactness costs.

mod albedo_pictures;
mod emission;
pub mod evaluate;
pub mod machine;
pub mod trade;
