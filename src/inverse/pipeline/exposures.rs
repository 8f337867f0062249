//! Records the stage of exposures.

use crate::calibrate::exposure::Exposures;
use crate::inverse::pipeline::Pipeline;
use glam::{DVec2, Vec3};

impl Pipeline<'_, '_> {
    /// Records the estimated exposures, vignetting and response.
    pub(super) fn tell_exposures(&mut self, exposures: &Exposures, started: f64) {
        let (min, max) = exposures.range();
        let fraction = exposures.gain.max(0.0) * 100.0;
        let mut why = if exposures.differ {
            format!(
                "exposure and white balance of each photograph, {min:.2} to {max:.2} times their median, explain {fraction:.0} % of \
                 the disagreement between photographs on shared surfaces"
            )
        } else {
            format!(
                "exposures would explain only {fraction:.0} % of the disagreement between photographs and are not used"
            )
        };
        if let Some((vignetting, camera)) =
            exposures.vignetting.zip(self.problem.scene.cameras.first())
        {
            let corner = vignetting.factor(&camera.intrinsics, DVec2::ZERO);
            why.push_str(&format!(
                "; vignetting to {:.0} % in the corners explains {:.0} % of the rest",
                corner.element_sum() / 3.0 * 100.0,
                exposures.vignetting_gain * 100.0
            ));
        }
        if let Some(response) = exposures.response {
            let [half, full] =
                [0.5, 1.0].map(|value| response.light(Vec3::splat(value), Vec3::ONE));
            let of_half = half / full * 100.0;
            why.push_str(&format!(
                "; a camera response that maps half of the largest value to {:.0} %, {:.0} % and {:.0} % of the largest radiance \
                 (red, green, blue) explains {:.0} % of what remains",
                of_half.x,
                of_half.y,
                of_half.z,
                exposures.response_gain * 100.0
            ));
        }
        self.record_unmeasured("exposures", started, exposures.needed(), why);
    }
}
