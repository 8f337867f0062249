//! Error over time, for presets and for variations of single settings.
//!
//! One solve gives many points: an observer measures its error while it runs. The solver's clock excludes the measurements.

pub mod combine;
pub mod compare;
mod curve;
mod measure;
mod metric;
pub mod plan;
pub mod plot;
mod record;
pub mod rooms;

pub use curve::{Curve, Measure, Point};
pub use measure::{SolveEvent, measure, watch};
pub use metric::Metric;
pub use record::Trade;
