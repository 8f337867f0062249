//! Corrects photographs for exposure, vignetting and response.

use crate::calibrate::exposure::Exposures;
use crate::calibrate::problem::Problem;
use crate::capture::exposure::Exposure;
use crate::capture::photograph::{BELOW_SATURATION, Photograph};
use glam::Vec3;
use rayon::prelude::*;
use std::sync::Arc;

impl Exposures {
    /// The problem with photographs of equal exposure and white balance, without vignetting, and linear in radiance.
    pub fn corrected(&self, problem: &Problem) -> Problem {
        let cameras = &problem.scene.cameras;
        let photographs = (problem.photographs.par_iter().zip(cameras))
            .zip(&self.factors)
            .map(|((photograph, camera), factor)| {
                let exposure = Exposure {
                    factor: *factor,
                    vignetting: self.vignetting,
                    response: self.response,
                };
                let saturation = photograph.saturation;
                let light = |value: Vec3| exposure.light(value, saturation);
                // A value counts as saturated afterwards if and only if it did before.
                let limit = |limit: Vec3| {
                    light(limit).min(light(limit * BELOW_SATURATION) / BELOW_SATURATION)
                };
                let size = [photograph.width, photograph.height];
                let factors: Vec<Vec3> = (0..photograph.pixels.len())
                    .map(|pixel| exposure.at(&camera.intrinsics, size, pixel))
                    .collect();
                let limit_varies = self.vignetting.is_some() && photograph.saturation.is_finite();
                let limits = match limit_varies || !photograph.limits.is_empty() {
                    true => (factors.iter().enumerate())
                        .map(|(pixel, factor)| limit(photograph.limit(pixel)) / *factor)
                        .collect(),
                    false => Vec::new(),
                };
                let pixels = photograph.pixels.iter().zip(&factors);
                Arc::new(Photograph {
                    pixels: pixels
                        .map(|(value, factor)| light(*value) / *factor)
                        .collect(),
                    saturation: limit(saturation) / *factor,
                    limits,
                    usable: photograph.usable.clone(),
                    ..**photograph
                })
            })
            .collect();
        Problem {
            photographs,
            ..problem.clone()
        }
    }
}
