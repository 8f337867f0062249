//! The light and materials that pictures are rendered with.

use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::transport::path::PathOptions;
use std::sync::Arc;

/// The estimate, the edited estimate, and options of their paths.
#[derive(Debug, Clone)]
pub struct Light {
    /// The estimate.
    pub found: Arc<Estimate>,
    /// The estimate with the edits; the same allocation without edits.
    pub edited: Arc<Estimate>,
    /// Options of the paths.
    pub options: PathOptions,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Light {
    /// The light of an estimate and its edits, with the paths of the solver's settings.
    pub fn new(found: Arc<Estimate>, edited: Arc<Estimate>, settings: &Settings) -> Self {
        Self {
            found,
            edited,
            options: path_options(settings),
            seed: settings.seed,
        }
    }

    /// Whether there are edits.
    pub fn is_edited(&self) -> bool {
        !Arc::ptr_eq(&self.found, &self.edited)
    }

    /// Whether both are identical: the same allocations, options and seed.
    pub fn is_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.found, &other.found)
            && Arc::ptr_eq(&self.edited, &other.edited)
            && self.options == other.options
            && self.seed == other.seed
    }
}

/// Options of the solver's paths: an estimate that was fitted with few bounces is only right with as few.
pub fn path_options(settings: &Settings) -> PathOptions {
    PathOptions {
        max_bounces: settings.max_bounces(),
        ..PathOptions::default()
    }
}
