//! What tells the error of an estimate: the truth where there is one, else pixels held out of the fit.

use crate::calibrate::problem::Problem;
use crate::inverse::estimate::Estimate;
use crate::inverse::loss::LossProbe;
use crate::inverse::settings::Settings;
use crate::study::evaluate::Reference;
use crate::study::trade::Measure;

/// Held-out pixels that are rendered, and paths for each.
const PIXELS: usize = 1000;
const SAMPLES: u64 = 16;

/// A judge of estimates.
#[derive(Debug, Clone)]
pub enum Judge {
    /// The truth.
    Truth(Box<Reference>),
    /// Held-out pixels, the same for all solves.
    HeldOut,
}

/// A judge of the estimates of one solve.
pub(super) enum Bench<'a> {
    Truth(&'a Reference),
    HeldOut(LossProbe),
}

impl Judge {
    /// What it measures.
    pub fn measure(&self) -> Measure {
        match self {
            Self::Truth(_) => Measure::Albedo,
            Self::HeldOut => Measure::HeldOut,
        }
    }

    /// Smallest ratio of the times of two points, so that judging takes no longer than solving.
    pub(super) fn spacing(&self) -> f64 {
        match self {
            Self::Truth(_) => 1.02,
            Self::HeldOut => 1.15,
        }
    }

    /// For the estimates of a solve with these parameters.
    pub(super) fn bench(&self, problem: &Problem, settings: &Settings) -> Bench<'_> {
        match self {
            Self::Truth(reference) => Bench::Truth(reference),
            Self::HeldOut => {
                let bounces = settings.max_bounces();
                let probe = LossProbe::new(problem, settings, PIXELS, SAMPLES, bounces);
                Bench::HeldOut(probe)
            }
        }
    }
}

impl Bench<'_> {
    /// The error; `None` where nothing can be compared.
    pub fn error(&self, problem: &Problem, estimate: &Estimate) -> Option<f64> {
        match self {
            Self::Truth(reference) => reference.errors(&problem.scene, estimate).albedo_mae,
            Self::HeldOut(probe) => probe.held_out(problem, estimate).0,
        }
    }
}
