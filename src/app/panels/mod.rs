//! Panes of words and numbers.

pub mod insert;
pub mod lights;
pub mod loss;
pub mod material;
pub mod objects;
pub mod plot;
pub mod report;
pub mod settings;
pub mod trade;
