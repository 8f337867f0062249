//! Combines curves of the same solves on several captures: geometric mean of the error, and its spread.

use crate::math::stats::Moments;
use crate::study::trade::curve::{Curve, Point};

/// Points of a mean curve, at times that grow by equal factors.
const POINTS: usize = 48;

/// The mean curve of each solve over captures; `captures` holds the same solves in the same order for each. A solve
/// that has ended keeps its last error. The mean begins when all have an estimate. Solves without an estimate on some
/// capture are left out.
pub fn combine(captures: &[Vec<Curve>]) -> Vec<Curve> {
    let Some(first) = captures.first() else {
        return Vec::new();
    };
    (first.iter().enumerate())
        .filter_map(|(index, curve)| {
            let same = captures.iter().map(|curves| curves.get(index));
            let same = same.map(|c| c.filter(|c| !c.points.is_empty()));
            let same: Vec<&Curve> = same.collect::<Option<_>>()?;
            Some(Curve {
                ended: None,
                rejected: same.iter().map(|c| c.rejected).sum(),
                points: mean(&same),
                ..curve.clone()
            })
        })
        .collect()
}

/// Points of the mean of curves that have points.
fn mean(curves: &[&Curve]) -> Vec<Point> {
    let seconds_of = |point: Option<&Point>| point.map_or(0.0, |p| p.seconds);
    let latest = |seconds: fn(&Curve) -> Option<&Point>| {
        let all = curves.iter().map(|curve| seconds_of(seconds(curve)));
        all.fold(f64::MIN_POSITIVE, f64::max)
    };
    let start = latest(|curve| curve.points.first());
    let end = latest(|curve| curve.points.last()).max(start);
    let count = if end > start { POINTS } else { 1 };
    (0..count)
        .map(|i| match i {
            // Exactly the end, so that rounding misses no solve's last point.
            _ if i + 1 == count => end,
            _ => start * (end / start).powf(i as f64 / (count - 1) as f64),
        })
        .map(|seconds| at(curves, seconds))
        .collect()
}

/// Mean of the curves' last points at or before a time.
fn at(curves: &[&Curve], seconds: f64) -> Point {
    let points: Vec<&Point> = (curves.iter())
        .filter_map(|curve| {
            let after = curve.points.partition_point(|p| p.seconds <= seconds);
            curve.points.get(after.saturating_sub(1))
        })
        .collect();
    let over = |value: fn(&Point) -> f64| points.iter().map(|p| value(p)).collect::<Moments>();
    // The logarithm of zero error is replaced by that of the smallest number.
    let logs = over(|point| point.error.max(f64::MIN_POSITIVE).ln());
    let reported: Moments = points.iter().filter_map(|point| point.reported).collect();
    let deviation = logs.variance().sqrt();
    Point {
        seconds,
        error: logs.mean.exp(),
        spread: Some([logs.mean - deviation, logs.mean + deviation].map(f64::exp)),
        reported: (reported.count == curves.len() as u64).then_some(reported.mean),
        rays: over(|point| point.rays as f64).mean as u64,
        iterations: over(|point| point.iterations as f64).mean as u64,
        pareto: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::settings::Preset;

    fn curve(points: &[[f64; 2]]) -> Curve {
        Curve::through(Preset::Balanced, points)
    }

    #[test]
    fn errors_are_averaged_by_their_logarithm_from_the_latest_start_to_the_latest_end() {
        let quick = vec![curve(&[[0.5, 0.1], [1.0, 0.04]])];
        let slow = vec![curve(&[[2.0, 0.4], [8.0, 0.01]])];
        let combined = combine(&[quick, slow]);
        let points = &combined[0].points;
        assert_eq!((points.len(), combined[0].rejected), (POINTS, 2));
        assert_eq!((points[0].seconds, points[POINTS - 1].seconds), (2.0, 8.0));
        // √(0.04 · 0.4), then √(0.04 · 0.01); one standard deviation of two logarithms is their difference / √2.
        assert!((points[0].error - 0.016f64.sqrt()).abs() < 1e-12);
        assert!((points[POINTS - 1].error - 0.02).abs() < 1e-12);
        let [low, high] = points[POINTS - 1].spread.expect("two captures");
        assert!(((high / low).ln() - 2.0 * 4f64.ln() / 2f64.sqrt()).abs() < 1e-9);
        assert!((points[0].reported.expect("both claim") - 0.22).abs() < 1e-12);
    }

    #[test]
    fn what_gave_no_estimate_somewhere_is_left_out() {
        assert!(combine(&[vec![curve(&[])], vec![curve(&[[1.0, 1.0]])]]).is_empty());
        assert!(combine(&[]).is_empty());
        assert_eq!(combine(&[vec![curve(&[[1.0, 0.5]])]])[0].points.len(), 1);
    }
}
