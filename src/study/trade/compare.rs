//! Speedup of the transport cache over the paper's descent, to the same error in the same run.

use crate::inverse::settings::Preset;
use crate::study::trade::curve::{Curve, Point};

/// Albedo error for comparing times.
const TARGET: f64 = 0.02;

/// The first point with at most this error.
pub fn reaches(curve: &Curve, error: f64) -> Option<&Point> {
    curve.points.iter().find(|point| point.error <= error)
}

/// The curve that reaches an error first, and its time in seconds.
fn first_to_reach<'a>(
    curves: impl Iterator<Item = &'a Curve>,
    error: f64,
) -> Option<(&'a Curve, f64)> {
    curves
        .filter_map(|curve| Some((curve, reaches(curve, error)?.seconds)))
        .min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Compares the presets with the paper's descent: times to an albedo error of 0.02, and to the smallest error of any descent.
pub fn against_paper(curves: &[Curve]) -> Vec<String> {
    let is_paper = |curve: &&Curve| curve.settings.preset == Preset::Paper;
    let paper = || curves.iter().filter(is_paper);
    let presets = || curves.iter().filter(|c| c.is_preset && !is_paper(c));
    let ends = paper().filter_map(|curve| curve.points.last());
    let longest = ends.map(|point| point.seconds).fold(0.0, f64::max);
    if longest == 0.0 {
        return Vec::new();
    }

    // To a given error.
    let mut findings = Vec::new();
    for curve in presets() {
        let Some(ours) = reaches(curve, TARGET).map(|point| point.seconds) else {
            continue;
        };
        let paper_time = match first_to_reach(paper(), TARGET) {
            Some((paper, seconds)) => format!(
                "{} in {seconds:.2} s: {:.1} times faster",
                paper.name,
                seconds / ours
            ),
            None => format!(
                "paper not within {longest:.1} s: more than {:.1} times faster",
                longest / ours
            ),
        };
        findings.push(format!(
            "{} reaches an albedo error of {TARGET} in {ours:.2} s, {paper_time}",
            curve.name
        ));
    }

    // To the smallest error of any descent.
    let best = paper()
        .flat_map(|curve| curve.points.iter().map(move |point| (curve, point)))
        .min_by(|a, b| a.1.error.total_cmp(&b.1.error));
    if let Some((paper, best)) = best
        && let Some((ours, seconds)) = first_to_reach(presets(), best.error)
    {
        findings.push(format!(
            "the smallest error of {} is {:.4} after {:.2} s; {} reaches it in {seconds:.2} s: {:.1} times faster",
            paper.name,
            best.error,
            best.seconds,
            ours.name,
            best.seconds / seconds
        ));
    }
    findings
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn times_to_the_same_error_are_compared() {
        let curves = [
            Curve::through(Preset::Balanced, &[[0.5, 0.05], [1.0, 0.01], [4.0, 0.003]]),
            Curve::through(
                Preset::Paper,
                &[[1.0, 0.5], [30.0, 0.02], [40.0, 0.009], [50.0, 0.011]],
            ),
        ];
        assert_eq!(
            against_paper(&curves),
            [
                "balanced reaches an albedo error of 0.02 in 1.00 s, paper in 30.00 s: 30.0 times faster",
                "the smallest error of paper is 0.0090 after 40.00 s; balanced reaches it in 4.00 s: 10.0 times faster",
            ]
        );
        let curves = [
            Curve::through(Preset::Balanced, &[[1.0, 0.01]]),
            Curve::through(Preset::Paper, &[[1.0, 0.5], [30.0, 0.1]]),
        ];
        let findings = against_paper(&curves);
        assert!(findings[0].ends_with("paper not within 30.0 s: more than 30.0 times faster"));
        assert!(against_paper(&curves[..1]).is_empty());
    }
}
