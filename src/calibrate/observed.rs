//! All that photographs tell before a solve, in the order in which one finding needs the other.

use crate::calibrate::censored;
use crate::calibrate::exposure::{Exposures, Observations, OutlierFrames};
use crate::calibrate::gbuffer::GBuffer;
use crate::calibrate::held_out::HoldOut;
use crate::calibrate::problem::Problem;

/// What is asked of the photographs.
#[derive(Debug, Clone, Copy)]
pub struct Questions {
    /// What no fit may see.
    pub hold_out: HoldOut,
    /// Key of the rays inside pixels.
    pub seed: u64,
    /// Pixels of the g-buffer, about.
    pub pixels: usize,
    /// Whether frames that contradict the others are left out.
    pub leave_out: bool,
    /// Whether exposures, vignetting and response are estimated.
    pub exposures: bool,
}

/// What the photographs tell.
pub struct Observed {
    /// The scene, with photographs of one exposure, without outlier frames, and with what is saturated as lower bounds.
    pub problem: Problem,
    /// What each pixel sees.
    pub gbuffer: GBuffer,
    /// How photographs differ in exposure, whether or not that was taken out; `None` where too few surfaces are shared.
    pub exposures: Option<Exposures>,
    /// Sentences on frames that were left out.
    pub warnings: Vec<String>,
    /// Rays cast for all of this.
    pub rays: u64,
}

impl Observed {
    /// Looks at the photographs of a problem.
    pub fn new(problem: &Problem, asked: Questions) -> Self {
        let gbuffer_of =
            |problem: &Problem| GBuffer::new(problem, asked.hold_out, asked.seed, asked.pixels);
        let mut problem = problem.clone();
        let mut gbuffer = gbuffer_of(&problem);
        let mut rays = gbuffer.rays;
        let mut warnings = Vec::new();

        // Frames that show something else than all others, as from a wrong pose.
        let mut observations =
            (asked.leave_out || asked.exposures).then(|| Observations::new(&problem, &gbuffer));
        let outliers = (observations.as_mut())
            .filter(|_| asked.leave_out)
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
            .filter(|_| asked.exposures)
            .and_then(|observations| Exposures::new(&problem, observations));
        if let Some(needed) = exposures.as_ref().filter(|e| e.needed()) {
            problem = needed.undone(&problem);
        }

        // Pixels beside saturated ones. Of a mesh that is no scan the mixtures at outlines are known.
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
