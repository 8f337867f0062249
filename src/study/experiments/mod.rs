//! The paper's experiments; `relit study NAME` runs one of them.
//!
//! The studies are listed in [`STUDIES`], from which the command and its help are made. They run on scenes of known
//! truth, rendered in memory, or on a capture, and return [`Findings`]: tables, plots and conclusions.

mod batch;
mod bounces;
mod box_room;
mod chair;
mod closed_form;
mod course;
mod courses;
mod estimators;
mod furnished;
mod gradient;
mod insertion;
mod likeness;
mod mis;
mod objects;
mod precision;
pub mod readings;
mod sampling;
mod selection;
mod standing;
mod study;
mod summed;
mod table1;
mod textures;
mod twin;

pub use crate::study::subject::Subject;
pub(super) use chair::chair_model;
pub(super) use insertion::insert;
pub(super) use standing::{Cylinder, places, up, upright};
pub use study::{Bench, Findings, Grid, Limits, Study, Summary};

/// All studies, in the order of `relit study all`.
pub const STUDIES: &[Study] = &[
    batch::STUDY,
    mis::STUDY,
    bounces::STUDY,
    textures::STUDY,
    table1::STUDY,
    insertion::STUDY,
    precision::STUDY,
    sampling::STUDY,
    estimators::STUDY,
    readings::STUDY,
];
