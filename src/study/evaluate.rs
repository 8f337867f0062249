//! Errors of an estimate against the truth of a capture.

use crate::capture::Capture;
use crate::capture::photograph::Photograph;
use crate::capture::truth::{ObjectTruth, Truth, read_albedo};
use crate::error::Result;
use crate::inverse::estimate::{ENOUGH_PIXELS, Estimate, ObjectEstimate};
use crate::math::stats::quantile;
use crate::scene::Scene;
use crate::study::albedo_pictures;
use crate::study::emission::{self, mean};
use glam::DVec3;
use serde::{Serialize, Serializer};
use std::path::Path;
use std::sync::Arc;

/// Errors of an estimate; `null` where nothing could be compared.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evaluation {
    /// Objects whose albedo is scored: in the truth, no emitter, not textured, and seen by 50 or more pixels.
    pub objects: usize,
    /// Mean absolute error of albedo over scored objects and RGB.
    pub albedo_mae: Option<f64>,
    /// Median over scored objects of ‖ρ̂ − ρ‖₂ / ‖ρ‖₂ over RGB.
    pub albedo_rel_median: Option<f64>,
    /// Its 95th percentile.
    pub albedo_rel_p95: Option<f64>,
    /// Peak signal-to-noise ratio in dB against the true albedo pictures, peak 1; `None` where these were not compared.
    pub albedo_psnr: Option<f64>,
    /// The same for the best estimate of one colour per object.
    pub albedo_psnr_constant_per_object: Option<f64>,
    /// Intersection over union of the emitters by area; an emitter exceeds 1 % of the largest luminance.
    pub emission_iou: Option<f64>,
    /// Mean over true emitters and RGB of ln² of the ratio, both sides raised by 1 % of the largest luminance.
    pub emission_log_mse: Option<f64>,
    /// Median over true emitters of the relative error over RGB.
    pub emission_rel_median: Option<f64>,
    /// Factor on the estimated light that fits the truth best; 1 unless the photographs are 8-bit, which leave the scale open.
    pub emission_scale: f64,
    /// Every object of the truth.
    #[serde(serialize_with = "as_map")]
    pub per_object: Vec<(String, ObjectErrors)>,
}

/// The errors of one object.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct ObjectErrors {
    /// Number of pixels whose centre sees it.
    pub pixels: u64,
    /// Whether it emits in the truth.
    pub emitter: bool,
    /// Whether its true albedo varies.
    pub textured: bool,
    /// Whether its albedo is scored.
    pub scored: bool,
    /// Estimated albedo.
    pub albedo: [f32; 3],
    /// True albedo, the mean if textured; `None` if the truth has none.
    pub albedo_true: Option<[f64; 3]>,
    /// Relative error of albedo over RGB.
    pub albedo_rel: Option<f64>,
    /// Estimated emission times the scale; exitance where the albedo could not be determined.
    pub emission: [f64; 3],
    /// The true value of `emission`.
    pub emission_true: [f64; 3],
    /// Relative error of emission over RGB, for emitters.
    pub emission_rel: Option<f64>,
}

/// The truth of a capture and the visibility of its objects, for comparing many estimates.
#[derive(Debug, Clone)]
pub struct Reference {
    truth: Truth,
    /// For each object, the number of pixels of all photographs, at full size, whose centre sees it.
    seen_pixels: Vec<u64>,
    /// Whether the photographs leave the scale of the light open.
    open_scale: bool,
}

impl Reference {
    /// The reference of `scene`; `capture` has cameras at the full size of their `photographs`.
    pub fn new(
        truth: Truth,
        capture: &Capture,
        scene: &Scene,
        photographs: &[Arc<Photograph>],
    ) -> Self {
        Self {
            truth,
            seen_pixels: albedo_pictures::seen_pixels(capture, scene),
            // Photographs that saturate come from a camera with unknown exposure.
            open_scale: photographs.iter().any(|p| p.saturation.is_finite()),
        }
    }

    /// Compares an estimate object by object, without pictures.
    pub fn errors(&self, scene: &Scene, estimate: &Estimate) -> Evaluation {
        let emission = emission::compare(scene, estimate, &self.truth, self.open_scale);
        let estimates = estimate.objects.iter().zip(&self.seen_pixels);
        let per_object: Vec<(String, ObjectErrors)> = (scene.objects.iter().zip(estimates))
            .filter_map(|(object, (estimated, &pixels))| {
                let known = self.truth.objects.get(&object.name)?;
                let errors = of_object(estimated, known, pixels, emission.scale);
                Some((object.name.clone(), errors))
            })
            .collect();
        let all = per_object.iter().map(|(_, errors)| errors);
        let scored: Vec<&ObjectErrors> = all.filter(|errors| errors.scored).collect();
        let absolute: Vec<f64> = scored
            .iter()
            .flat_map(|o| {
                o.albedo
                    .into_iter()
                    .zip(o.albedo_true.into_iter().flatten())
            })
            .map(|(found, known)| (f64::from(found) - known).abs())
            .collect();
        let mut relative: Vec<f64> = scored.iter().filter_map(|o| o.albedo_rel).collect();
        let mut lamps: Vec<f64> = (per_object.iter())
            .filter_map(|(_, o)| o.emission_rel)
            .collect();
        Evaluation {
            objects: scored.len(),
            albedo_mae: mean(&absolute),
            albedo_rel_median: quantile(&mut relative, 0.5),
            albedo_rel_p95: quantile(&mut relative, 0.95),
            albedo_psnr: None,
            albedo_psnr_constant_per_object: None,
            emission_iou: emission.iou,
            emission_log_mse: emission.log_mse,
            emission_rel_median: quantile(&mut lamps, 0.5),
            emission_scale: emission.scale,
            per_object,
        }
    }
}

/// Compares an estimate with the truth of the capture in `folder`; `capture` and `scene` are the estimate's. `photographs`
/// determine whether the scale of the light is open.
///
/// # Errors
/// The truth is missing or broken, or a true picture is of another size than its frame.
pub fn evaluate(
    folder: &Path,
    capture: &Capture,
    scene: &Scene,
    photographs: &[Arc<Photograph>],
    estimate: &Estimate,
) -> Result<Evaluation> {
    let truth = Truth::read(folder)?;
    let pictures = albedo_pictures::compare(capture, scene, estimate, &truth, |index, frame| {
        let picture = read_albedo(folder, index, &frame.intrinsics)?;
        Ok(picture.map(|picture| picture.pixels))
    })?;
    let reference = Reference::new(truth, capture, scene, photographs);
    Ok(Evaluation {
        albedo_psnr: pictures.psnr(),
        albedo_psnr_constant_per_object: pictures.psnr_constant_per_object(),
        ..reference.errors(scene, estimate)
    })
}

fn of_object(
    estimated: &ObjectEstimate,
    known: &ObjectTruth,
    pixels: u64,
    scale: f64,
) -> ObjectErrors {
    let emitter = known.is_emitter();
    let light = estimated.emission.as_dvec3() * scale;
    let light_true = emission::comparable(estimated, known);
    ObjectErrors {
        pixels,
        emitter,
        textured: known.textured,
        scored: known.albedo.is_some() && !emitter && !known.textured && pixels >= ENOUGH_PIXELS,
        albedo: estimated.albedo.to_array(),
        albedo_true: known.albedo.map(|albedo| albedo.to_array()),
        albedo_rel: (known.albedo).and_then(|albedo| relative(estimated.albedo.as_dvec3(), albedo)),
        emission: light.to_array(),
        emission_true: light_true.to_array(),
        emission_rel: relative(light, light_true).filter(|_| emitter),
    }
}

/// Relative error ‖a − b‖₂ / ‖b‖₂; `None` where b is zero.
fn relative(a: DVec3, b: DVec3) -> Option<f64> {
    (b != DVec3::ZERO).then(|| (a - b).length() / b.length())
}

fn as_map<S: Serializer>(
    pairs: &[(String, ObjectErrors)],
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    serializer.collect_map(pairs.iter().map(|(name, errors)| (name, errors)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lamps_are_scored_by_their_light_and_surfaces_by_their_albedo() {
        let estimated = ObjectEstimate {
            albedo: glam::Vec3::new(0.3, 0.4, 0.0),
            emission: glam::Vec3::new(3.0, 4.0, 0.0),
            albedo_identifiable: false,
            ..ObjectEstimate::default()
        };
        let lamp = ObjectTruth {
            emission: DVec3::new(2.0, 3.0, 0.0),
            exitance: Some(DVec3::new(3.0, 4.0, 1.0)),
            ..ObjectTruth::default()
        };
        let errors = of_object(&estimated, &lamp, 1000, 1.0);
        assert!(!errors.scored && errors.emitter);
        assert!((errors.emission_rel.expect("an emitter") - 1.0 / 26f64.sqrt()).abs() < 1e-6);
        let wall = ObjectTruth {
            albedo: Some(DVec3::new(0.3, 0.0, 0.0)),
            ..ObjectTruth::default()
        };
        let errors = of_object(&estimated, &wall, 50, 1.0);
        assert!(errors.scored && errors.emission_rel.is_none());
        assert!((errors.albedo_rel.expect("not black") - 0.4 / 0.3).abs() < 1e-6);
        assert!(!of_object(&estimated, &wall, 49, 1.0).scored);
        let unknown = of_object(&estimated, &ObjectTruth::default(), 50, 1.0);
        assert!(!unknown.scored && unknown.albedo_true.is_none());
        let textured = ObjectTruth {
            textured: true,
            ..wall
        };
        assert!(!of_object(&estimated, &textured, 50, 1.0).scored);
    }
}
