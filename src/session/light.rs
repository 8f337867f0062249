//! How the light of an estimate is traced for pictures.

use crate::inverse::settings::{Preset, Settings};
use crate::transport::path::PathOptions;

/// Bounces that the paper's solver takes when none are set.
const PAPER_BOUNCES: u32 = 2;

/// Paths as the solver took them: an estimate fitted with few bounces is only right with as few.
pub fn path_options(settings: &Settings) -> PathOptions {
    let all = PathOptions::default();
    let max_bounces = match (settings.bounces, settings.preset) {
        (0, Preset::Paper) => PAPER_BOUNCES,
        (0, _) => all.max_bounces,
        (bounces, _) => u32::try_from(bounces).unwrap_or(u32::MAX),
    };
    PathOptions { max_bounces, ..all }
}
