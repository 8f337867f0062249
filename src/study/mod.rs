//! Measurements on finished work: how far an estimate is from the truth, what exactness costs, and the paper's
//! experiments rerun.

mod albedo_pictures;
mod emission;
pub mod evaluate;
pub mod experiments;
pub mod families;
pub mod machine;
pub mod trade;
