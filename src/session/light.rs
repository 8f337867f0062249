//! How the light of an estimate is traced for pictures.

use crate::inverse::settings::Settings;
use crate::transport::path::PathOptions;

/// Paths as the solver took them: an estimate fitted with few bounces is only right with as few.
pub fn path_options(settings: &Settings) -> PathOptions {
    PathOptions {
        max_bounces: settings.max_bounces(),
        ..PathOptions::default()
    }
}
