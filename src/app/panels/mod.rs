//! Panes of words and numbers.

pub mod capture;
pub mod insert;
pub mod log;
pub mod loss;
pub mod objects;
pub mod settings;
pub mod stages;
pub mod trade;
