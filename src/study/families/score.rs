//! Solves one room and compares it with its truth.

use crate::calibrate::held_out::HoldOut;
use crate::calibrate::problem::Problem;
use crate::calibrate::segments::segment_mesh;
use crate::capture::Capture;
use crate::capture::working::load_working;
use crate::error::Result;
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::inverse::solve;
use crate::inverse::solver::{Control, Observer, Progress, Solution};
use crate::math::color::luminance_f64;
use crate::math::stats::weighted_median;
use crate::room::generated::{Family, Generated};
use crate::scene::Scene;
use crate::scene::prepare::prepare;
use crate::study::albedo_pictures;
use crate::study::evaluate::{ObjectErrors, Reference};
use crate::study::families::Plan;
use crate::study::families::row::Row;
use crate::study::families::segments;
use crate::transport::environment::Environment;
use glam::DVec3;
use std::sync::Arc;

/// Largest factor between the estimated and the true emission of a lamp that counts as found.
const FACTOR: f64 = 2.0;
/// An object without emission is a false lamp above this fraction of the largest true emission.
const FALSE_FRACTION: f64 = 0.01;

/// A room and its solution.
pub struct Solved {
    pub room: Generated,
    /// The capture that was solved; cut into segments if it is a scan.
    pub capture: Capture,
    pub problem: Problem,
    pub solution: Solution,
}

/// Generates a room and solves it like `relit solve`.
///
/// # Errors
/// The room cannot be generated or solved.
pub fn solved(family: Family, seed: u64, plan: &Plan) -> Result<Solved> {
    let settings = Settings {
        preset: plan.preset,
        seed,
        ..Settings::default()
    };
    let room = family.generate(seed, plan.size)?;
    let mut capture = room.capture.clone();
    let working = load_working(&capture, u64::MAX)?;
    if let Some(cut) = capture.segmentation.clone() {
        segment_mesh(&mut capture, &cut, &working, HoldOut::from(&settings))?;
    }
    let prepared = prepare(&capture, &working)?;
    let problem = Problem {
        scene: Arc::new(prepared.scene),
        photographs: prepared.photographs,
    };
    let solution = solve(&problem, &settings, None, &mut Unwatched)?;
    Ok(Solved {
        room,
        capture: prepared.capture,
        problem,
        solution,
    })
}

/// Solves a room and compares the estimate with the truth.
///
/// # Errors
/// The room cannot be generated or solved.
pub fn measure(family: Family, seed: u64, plan: &Plan) -> Result<Row> {
    let Solved {
        room,
        capture,
        problem,
        solution,
    } = solved(family, seed, plan)?;
    let (scene, estimate) = (&problem.scene, &solution.estimate);
    let truth = match room.capture.segmentation {
        Some(_) => segments::truth(&room, scene),
        None => room.truth(),
    };
    let pictures = albedo_pictures::compare(&capture, scene, estimate, &truth, |frame, _| {
        Ok(Some(room.albedo(frame).pixels))
    })?;
    let reference = Reference::new(truth, &capture, scene, &problem.photographs);
    let errors = reference.errors(scene, estimate);
    let lamps = count_lamps(&errors.per_object, room.lit.outside.as_deref());
    let claimed = claimed(scene, estimate, &errors.per_object);
    let coverage = |errors: f64| {
        let within = claimed.iter().filter(|(off, error)| *off <= errors * error);
        (!claimed.is_empty()).then(|| within.count() as f64 / claimed.len() as f64)
    };
    Ok(Row {
        relit: env!("CARGO_PKG_VERSION").to_owned(),
        preset: plan.preset.word().to_owned(),
        width: plan.size[0],
        height: plan.size[1],
        family,
        seed,
        seconds: solution.progress.seconds,
        objects: errors.objects as u64,
        albedo_mae: errors.albedo_mae,
        albedo_rel_median: errors.albedo_rel_median,
        albedo_psnr: pictures.psnr(),
        lamps_true: lamps.true_count,
        lamps_found: lamps.found,
        lamps_false: lamps.false_count,
        albedos: claimed.len() as u64,
        coverage_1: coverage(1.0),
        coverage_2: coverage(2.0),
        rays: solution.progress.rays,
        albedo_factor: common_factor(&errors.per_object),
    })
}

/// Median over scored objects of found over true albedo (sums over RGB), weighted by pixels.
fn common_factor(errors: &[(String, ObjectErrors)]) -> Option<f64> {
    let factors = (errors.iter())
        .filter(|(_, errors)| errors.scored)
        .filter_map(|(_, errors)| {
            let [found, known] =
                [errors.albedo.map(f64::from), errors.albedo_true?].map(|c| c.iter().sum::<f64>());
            (known > 0.0).then_some((found / known, errors.pixels as f64))
        });
    weighted_median(factors.collect())
}

/// An observer that never stops a solve.
struct Unwatched;

impl Observer for Unwatched {
    fn observe(&mut self, _: &Progress, _: &Estimate) -> Control {
        Control::Continue
    }
}

/// Albedos by channel of all objects whose albedo is scored and reported as determined: the error of each, and its standard error.
fn claimed(
    scene: &Scene,
    estimate: &Estimate,
    errors: &[(String, ObjectErrors)],
) -> Vec<(f64, f64)> {
    let scored = errors.iter().filter(|(_, errors)| errors.scored);
    let known = scored.filter_map(|(name, errors)| {
        let mut objects = scene.objects.iter();
        let place = objects.position(|object| object.name == *name)?;
        let estimated = estimate.objects.get(place)?;
        Some((estimated, errors.albedo_true?)).filter(|_| estimated.albedo_identifiable)
    });
    let channels = known.flat_map(|(estimated, known)| {
        [0, 1, 2].map(|c| {
            let off = (f64::from(estimated.albedo[c]) - known[c]).abs();
            (off, f64::from(estimated.albedo_stderr[c]))
        })
    });
    channels.collect()
}

/// Numbers of lamps.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Lamps {
    /// True lamps.
    true_count: u64,
    /// True lamps whose brightness was found.
    found: u64,
    /// False lamps: objects without emission that were given one.
    false_count: u64,
}

/// Counts lamps by luminance. Without true lamps, false ones are measured against the mean radiance from outside.
fn count_lamps(errors: &[(String, ObjectErrors)], outside: Option<&Environment>) -> Lamps {
    let light = |emission: [f64; 3]| luminance_f64(DVec3::from(emission));
    let lamps = errors.iter().filter(|(_, errors)| errors.emitter);
    let brightest = lamps.map(|(_, errors)| light(errors.emission_true));
    let sky = || outside.map_or(0.0, |map| map.power() / (4.0 * std::f64::consts::PI));
    let brightest = brightest.reduce(f64::max).unwrap_or_else(sky);
    let mut lamps = Lamps::default();
    for (_, errors) in errors {
        let [estimated, known] = [errors.emission, errors.emission_true].map(light);
        if errors.emitter {
            lamps.true_count += 1;
            lamps.found += u64::from(estimated <= FACTOR * known && known <= FACTOR * estimated);
        } else {
            lamps.false_count += u64::from(estimated > FALSE_FRACTION * brightest);
        }
    }
    lamps
}

#[cfg(test)]
mod tests {
    use super::*;

    fn object(emission: f64, known: f64) -> (String, ObjectErrors) {
        let errors = ObjectErrors {
            emitter: known > 0.0,
            emission: [emission; 3],
            emission_true: [known; 3],
            ..ObjectErrors::default()
        };
        (String::new(), errors)
    }

    #[test]
    fn a_factor_of_two_is_found_and_a_hundredth_of_the_brightest_is_made_up() {
        let objects = [
            object(5.1, 10.0),
            object(4.9, 10.0),
            object(19.9, 10.0),
            object(20.1, 10.0),
            object(0.11, 0.0),
            object(0.09, 0.0),
        ];
        let expected = Lamps {
            true_count: 4,
            found: 2,
            false_count: 1,
        };
        assert_eq!(count_lamps(&objects, None), expected);
        let sky = Environment::new(4, 2, vec![glam::Vec3::ONE; 8]);
        let dark = [object(0.02, 0.0), object(0.005, 0.0)];
        assert_eq!(count_lamps(&dark, sky.as_ref()).false_count, 1);
    }
}
