//! Panes of words and numbers.

pub(super) mod insert;
pub(super) mod lights;
pub(super) mod loss;
pub(super) mod material;
pub mod objects;
pub(super) mod plot;
pub(super) mod report;
pub(super) mod settings;
pub(super) mod trade;
