//! The table that ends a solve.

use crate::inverse::estimate::{Estimate, ObjectEstimate};
use crate::inverse::solver::{Progress, Termination};
use crate::say;
use crate::scene::Scene;
use glam::Vec3;
use std::borrow::Cow;

/// Most rows printed; report.json has all.
const ROWS: usize = 24;

/// Table of objects with standard errors, sorted by emission, then by the number of pixels that see them.
pub fn objects(scene: &Scene, estimate: &Estimate) -> String {
    let names = scene.objects.iter().map(|o| say::plain(&o.name));
    let mut rows: Vec<(Cow<str>, &ObjectEstimate)> = names.zip(&estimate.objects).collect();
    rows.sort_by(|(_, a), (_, b)| {
        let brightness = |o: &ObjectEstimate| o.emission.element_sum();
        brightness(b)
            .total_cmp(&brightness(a))
            .then(b.seen_pixels.cmp(&a.seen_pixels))
    });
    let shown = rows.len().min(ROWS);
    let widths = rows[..shown].iter().map(|(name, _)| name.chars().count());
    let width = widths.max().unwrap_or(0).max(6);
    let mut text = format!(
        "{:width$}  {:>24}  {:>9}  {:>17}  {:>7}  {:>8}\n",
        "object", "emission", "±", "albedo", "±", "pixels"
    );
    for (name, object) in &rows[..shown] {
        let [r, g, b] = object.emission.to_array();
        let emission = format!("{r:.4} {g:.4} {b:.4}");
        let [r, g, b] = object.albedo.to_array();
        let albedo = match object.albedo_identifiable {
            true => format!("{r:.3} {g:.3} {b:.3}"),
            false => "not determined".to_owned(),
        };
        let emission_error = error(object.emission_stderr, 4);
        let (albedo_error, pixels) = (error(object.albedo_stderr, 3), object.seen_pixels);
        text += &format!("{name:width$}  {emission:>24}  {emission_error:>9}  ");
        text += &format!("{albedo:>17}  {albedo_error:>7}  {pixels:>8}\n");
    }
    if estimate.common_error > 0.0 {
        text += &format!(
            "one factor of all albedos together is known to ±{:.0} %; their ratios are known better\n",
            estimate.common_error * 100.0
        );
    }
    if rows.len() > shown {
        text += &format!("… and {} more in report.json\n", rows.len() - shown);
    }
    text
}

fn error(stderr: Vec3, digits: usize) -> String {
    let worst = stderr.max_element();
    // f32::MAX stands for an unknown error.
    match worst < f32::MAX {
        true => format!("{worst:.digits$}"),
        false => "?".to_owned(),
    }
}

/// One line on why and when the solve ended.
pub fn ending(progress: &Progress, termination: Termination) -> String {
    let why = match termination {
        Termination::Converged => "converged",
        Termination::Target => "the target error is reached",
        Termination::Time => "the time is up",
        Termination::Steps => "the steps are done",
        Termination::Cancelled => "stopped",
        Termination::Diverged => "diverged; this is the last finite estimate",
    };
    format!(
        "{why} after {:.1} s, {} iterations, {:.1} million rays",
        progress.seconds,
        progress.iterations,
        progress.rays as f64 * 1e-6
    )
}
