//! The light that pictures are made in.

use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::transport::path::PathOptions;
use std::sync::Arc;

/// The light and the materials that were found, those that are shown, and how their paths are traced.
#[derive(Debug, Clone)]
pub struct Light {
    /// What was found.
    pub found: Arc<Estimate>,
    /// The same with the changes made by hand; the same allocation where there are none.
    pub edited: Arc<Estimate>,
    /// How its paths are traced.
    pub options: PathOptions,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Light {
    /// Light as a solver with these settings found it and as it was changed.
    pub fn new(found: Arc<Estimate>, edited: Arc<Estimate>, settings: &Settings) -> Self {
        Self {
            found,
            edited,
            options: path_options(settings),
            seed: settings.seed,
        }
    }

    /// Whether anything was changed by hand.
    pub fn is_changed(&self) -> bool {
        !Arc::ptr_eq(&self.found, &self.edited)
    }

    /// Whether it is the very same light.
    pub fn is(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.found, &other.found)
            && Arc::ptr_eq(&self.edited, &other.edited)
            && self.options == other.options
            && self.seed == other.seed
    }
}

/// Paths as the solver took them: an estimate fitted with few bounces is only right with as few.
pub fn path_options(settings: &Settings) -> PathOptions {
    PathOptions {
        max_bounces: settings.max_bounces(),
        ..PathOptions::default()
    }
}
