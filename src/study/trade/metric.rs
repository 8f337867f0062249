//! Measures the error of an estimate: against the truth if known, else on held-out pixels.

use crate::calibrate::problem::Problem;
use crate::inverse::estimate::Estimate;
use crate::inverse::loss::LossProbe;
use crate::inverse::settings::Settings;
use crate::study::evaluate::Reference;
use crate::study::trade::curve::Measure;

/// Held-out pixels that are rendered.
const PIXELS: usize = 1000;
/// Samples for each of these pixels.
const SAMPLES: u64 = 16;

/// The error of an estimate; `None` if nothing can be compared.
pub(super) type ErrorOf<'a> = Box<dyn Fn(&Estimate) -> Option<f64> + 'a>;

/// How the error of estimates is measured.
#[derive(Debug, Clone)]
pub enum Metric {
    /// Against the truth.
    Truth(Box<Reference>),
    /// On held-out pixels, the same for all solves.
    HeldOut,
}

impl Metric {
    /// The quantity that is measured.
    pub fn measure(&self) -> Measure {
        match self {
            Self::Truth(_) => Measure::Albedo,
            Self::HeldOut => Measure::HeldOut,
        }
    }

    /// Smallest ratio between the times of two points, so that measuring takes no longer than solving.
    pub(super) fn spacing(&self) -> f64 {
        match self {
            Self::Truth(_) => 1.02,
            Self::HeldOut => 1.15,
        }
    }

    /// Prepares measuring the estimates of a solve with these parameters.
    pub(super) fn for_solve<'a>(
        &'a self,
        problem: &'a Problem,
        settings: &Settings,
    ) -> ErrorOf<'a> {
        match self {
            Self::Truth(reference) => {
                Box::new(move |estimate| reference.errors(&problem.scene, estimate).albedo_mae)
            }
            Self::HeldOut => {
                let bounces = settings.max_bounces();
                let probe = LossProbe::new(problem, settings, PIXELS, SAMPLES, bounces);
                Box::new(move |estimate| probe.held_out(problem, estimate).0)
            }
        }
    }
}
