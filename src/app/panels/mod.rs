//! Panes of words and numbers.

pub mod capture;
pub mod insert;
pub mod lights;
pub mod log;
pub mod loss;
pub mod material;
pub mod objects;
pub mod plot;
pub mod settings;
pub mod stages;
pub mod trade;
