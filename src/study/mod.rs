//! Measurements on finished work: how far an estimate is from the truth.

mod albedo_pictures;
mod emission;
pub mod evaluate;
