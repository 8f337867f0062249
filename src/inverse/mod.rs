//! The solvers: from photographs to an estimate with standard errors.
//!
//! [`solve`] selects the solver: [`pipeline`] (the transport cache; all presets but one) or [`paper`]. Neither imports the
//! other. [`paths`] holds stored paths and their derivatives, [`fit`] their least-squares fit, [`emitters`] the classification
//! of objects as lamps; [`lobe`] and [`texture`] add detail to the one albedo per object.

pub mod emitters;
pub mod estimate;
pub mod fit;
pub mod known;
pub mod lobe;
pub mod loss;
pub mod monitor;
pub mod outside;
pub mod paper;
pub mod paths;
pub mod pipeline;
pub mod roles;
pub mod settings;
pub mod sky;
pub mod solver;
pub mod texture;
pub mod unknowns;

use crate::calibrate::held_out::HoldOut;
use crate::calibrate::problem::Problem;
use crate::error::Result;
use monitor::Monitor;
use settings::{Preset, Settings};
use solver::{Checkpoint, Observer, Solution};

/// Runs the solver of the settings' preset.
///
/// # Errors
/// The checkpoint belongs to another capture or preset, or all photographs are to be held out.
pub fn solve(
    problem: &Problem,
    settings: &Settings,
    resume: Option<&Checkpoint>,
    observer: &mut dyn Observer,
) -> Result<Solution> {
    HoldOut::from(settings).check(problem.photographs.len())?;
    let progress = resume.map(|c| c.progress.clone()).unwrap_or_default();
    let monitor = Monitor::new(settings, observer, progress);
    match settings.preset {
        Preset::Paper => paper::solve(problem, settings, resume, monitor),
        Preset::Preview | Preset::Balanced | Preset::Reference => {
            pipeline::solve(problem, settings, resume, monitor)
        }
    }
}
