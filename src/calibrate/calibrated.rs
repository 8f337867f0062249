//! All steps from photographs to observations, in order of their dependencies.

use crate::calibrate::censored;
use crate::calibrate::exposure::{Exposures, Observations, OutlierFrames};
use crate::calibrate::gbuffer::GBuffer;
use crate::calibrate::held_out::HoldOut;
use crate::calibrate::problem::Problem;

/// The observations that a solve fits.
pub struct Calibrated {
    /// The scene, with photographs at one exposure, outlier frames unusable, and saturated values as lower bounds.
    pub problem: Problem,
    /// What each pixel sees.
    pub gbuffer: GBuffer,
    /// Estimated exposures, whether or not they were corrected; `None` if too few surfaces are shared between photographs.
    pub exposures: Option<Exposures>,
    /// One sentence per frame that was left out.
    pub warnings: Vec<String>,
    /// Rays cast in total.
    pub rays: u64,
}

/// How photographs are prepared.
#[derive(Debug, Clone, Copy)]
pub struct CalibrationOptions {
    /// The pixels that are kept from fits.
    pub hold_out: HoldOut,
    /// Seed of the g-buffer's rays.
    pub seed: u64,
    /// Number of pixels of the g-buffer, about.
    pub pixels: usize,
    /// Whether frames that contradict the others are left out.
    pub leave_out: bool,
    /// Whether exposures, vignetting and response are estimated.
    pub exposures: bool,
}

impl Calibrated {
    /// Prepares the photographs of a problem.
    pub fn new(problem: &Problem, options: CalibrationOptions) -> Self {
        let CalibrationOptions {
            hold_out,
            seed,
            pixels,
            leave_out,
            exposures: expose,
        } = options;
        let gbuffer_of = |problem: &Problem| GBuffer::new(problem, hold_out, seed, pixels);
        let mut problem = problem.clone();
        let mut gbuffer = gbuffer_of(&problem);
        let mut rays = gbuffer.rays;
        let mut warnings = Vec::new();

        // Outlier frames: they contradict the others, for example because of a wrong pose.
        let mut observations = (leave_out || expose).then(|| Observations::new(&problem, &gbuffer));
        let outliers = (observations.as_mut())
            .filter(|_| leave_out)
            .and_then(|observations| OutlierFrames::new(observations, problem.photographs.len()))
            .filter(|outliers| !outliers.outliers.is_empty());
        if let Some(outliers) = outliers {
            problem = outliers.without_outliers(&problem);
            gbuffer = gbuffer_of(&problem);
            rays += gbuffer.rays;
            warnings = outliers.remarks();
        }

        // Exposure, white balance, vignetting and response.
        let exposures = (observations.as_ref())
            .filter(|_| expose)
            .and_then(|observations| Exposures::new(&problem, observations));
        if let Some(needed) = exposures.as_ref().filter(|e| e.needed()) {
            problem = needed.corrected(&problem);
        }

        // Censored pixels around saturated lamps. A mesh that is not a scan has exact outlines: its mixed pixels are modelled.
        if problem.scene.scanned
            && let Some(bounded) = censored::bounded(&problem, &gbuffer)
        {
            problem = bounded;
        }
        Self {
            problem,
            gbuffer,
            exposures,
            warnings,
            rays,
        }
    }
}
