//! Errors of the emission: which emitters are found, and how bright.

use crate::capture::truth::{ObjectTruth, Truth};
use crate::inverse::estimate::{Estimate, ObjectEstimate};
use crate::math::color::luminance_f64;
use crate::scene::Scene;
use glam::DVec3;

/// An object counts as an emitter above this fraction of the largest luminance.
const THRESHOLD: f64 = 0.01;

/// Errors over all emitters.
#[derive(Debug, Clone, PartialEq)]
pub struct EmissionErrors {
    /// Intersection over union by area.
    pub iou: Option<f64>,
    /// Mean squared logarithmic error over true emitters.
    pub log_mse: Option<f64>,
    /// Factor on the estimate that fits the truth best; 1 unless the scale is open.
    pub scale: f64,
}

/// The true value of an estimated emission: exitance if the albedo could not be determined, else emission.
pub fn comparable(estimated: &ObjectEstimate, known: &ObjectTruth) -> DVec3 {
    match known.exitance {
        Some(exitance) if !estimated.albedo_identifiable => exitance,
        _ => known.emission,
    }
}

struct Lamp {
    area: f64,
    estimated: DVec3,
    known: DVec3,
    emits: bool,
}

/// Compares the emission of all objects that the truth contains. With `open_scale` the estimate is scaled to fit first.
pub fn compare(
    scene: &Scene,
    estimate: &Estimate,
    truth: &Truth,
    open_scale: bool,
) -> EmissionErrors {
    let lamps: Vec<Lamp> = (scene.objects.iter().zip(&estimate.objects))
        .filter_map(|(object, estimated)| {
            let known = truth.objects.get(&object.name)?;
            Some(Lamp {
                area: object.area,
                estimated: estimated.emission.as_dvec3(),
                known: comparable(estimated, known),
                emits: known.is_emitter(),
            })
        })
        .collect();
    errors(&lamps, open_scale)
}

fn errors(lamps: &[Lamp], open_scale: bool) -> EmissionErrors {
    // The least-squares scale, weighted by area.
    let weighted = |value: fn(&Lamp) -> f64| lamps.iter().map(|l| l.area * value(l)).sum::<f64>();
    let scale = match weighted(|l| l.estimated.length_squared()) {
        power if open_scale && power > 0.0 => weighted(|l| l.estimated.dot(l.known)) / power,
        _ => 1.0,
    };

    // Overlap of the emitting areas.
    let brightest = |light: fn(&Lamp) -> DVec3| {
        let luminances = lamps.iter().map(|l| luminance_f64(light(l)));
        luminances.fold(0.0f64, f64::max)
    };
    let (top_estimated, top_known) = (
        brightest(|l| l.estimated),
        brightest(|l| if l.emits { l.known } else { DVec3::ZERO }),
    );
    let (mut both, mut either) = (0.0, 0.0);
    for lamp in lamps {
        let found = luminance_f64(lamp.estimated) > THRESHOLD * top_estimated;
        let emits = lamp.emits && luminance_f64(lamp.known) > THRESHOLD * top_known;
        both += if found && emits { lamp.area } else { 0.0 };
        either += if found || emits { lamp.area } else { 0.0 };
    }
    let iou = match (lamps.is_empty(), either > 0.0) {
        (true, _) => None,
        (false, true) => Some(both / either),
        // Neither true nor estimated emitters.
        (false, false) => Some(1.0),
    };

    // Brightness of the true emitters.
    let floor = THRESHOLD * top_known;
    let logs: Vec<f64> = lamps
        .iter()
        .filter(|lamp| lamp.emits)
        .flat_map(|lamp| {
            let estimated = lamp.estimated.to_array().into_iter();
            let pairs = estimated.zip(lamp.known.to_array());
            pairs.map(|(e, k)| ((e.max(0.0) * scale + floor) / (k + floor)).ln().powi(2))
        })
        .collect();
    EmissionErrors {
        iou,
        log_mse: mean(&logs),
        scale,
    }
}

/// The mean; `None` without values.
pub(super) fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lamp(area: f64, estimated: f64, known: f64) -> Lamp {
        Lamp {
            area,
            estimated: DVec3::splat(estimated),
            known: DVec3::splat(known),
            emits: known > 0.0,
        }
    }

    #[test]
    fn overlap_counts_areas_and_faint_glow_is_no_emitter() {
        let found = errors(&[lamp(2.0, 10.0, 10.0), lamp(9.0, 0.09, 0.0)], false);
        assert_eq!(found.iou, Some(1.0));
        assert_eq!(found.log_mse, Some(0.0));
        let false_one = errors(&[lamp(2.0, 10.0, 10.0), lamp(6.0, 0.2, 0.0)], false);
        assert_eq!(false_one.iou, Some(0.25));
        let missed = errors(&[lamp(2.0, 10.0, 10.0), lamp(2.0, 0.0, 5.0)], false);
        assert_eq!(missed.iou, Some(0.5));
        assert!(missed.log_mse.is_some_and(|e| e > 1.0));
        assert_eq!(errors(&[lamp(1.0, 0.0, 0.0)], false).iou, Some(1.0));
        assert_eq!(errors(&[], false).iou, None);
    }

    #[test]
    fn an_open_scale_is_fitted_and_a_closed_one_counts() {
        let lamps = || [lamp(1.0, 2.0, 6.0), lamp(3.0, 1.0, 3.0)];
        let open = errors(&lamps(), true);
        assert!((open.scale - 3.0).abs() < 1e-12);
        assert!(open.log_mse.is_some_and(|e| e < 1e-12));
        let closed = errors(&lamps(), false);
        assert_eq!(closed.scale, 1.0);
        let off = closed.log_mse.map(|e| (e.sqrt() - 3f64.ln()).abs());
        assert!(off.is_some_and(|off| off < 0.05));
    }
}
