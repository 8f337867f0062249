//! Plot of error over seconds on logarithmic axes, with the presets named and the Pareto front marked.

use crate::export::plot::{Axis, Draw, Plot, Series};
use crate::study::trade::curve::{Curve, Point};
use crate::study::trade::record::Trade;

/// The plot of a trade.
pub fn plot(trade: &Trade) -> Plot {
    let points = |points: &[Point]| -> Vec<[f64; 2]> {
        points.iter().map(|p| [p.seconds, p.error]).collect()
    };
    let presets = || trade.curves.iter().filter(|curve| curve.is_preset);

    // Presets as curves, variations as dots.
    let mut series: Vec<Series> = presets()
        .map(|curve| Series {
            band: (curve.points.iter()).filter_map(|p| p.spread).collect(),
            ..Series::line(&curve.name, points(&curve.points))
        })
        .filter(|series| !series.points.is_empty())
        .collect();
    let varied = trade.curves.iter().filter(|curve| !curve.is_preset);
    let varied: Vec<[f64; 2]> = varied.flat_map(|curve| points(&curve.points)).collect();
    if !varied.is_empty() {
        series.push(Series {
            draw: Draw::Dots,
            ..Series::line("one setting changed", varied)
        });
    }
    series.push(Series {
        draw: Draw::Steps,
        ..Series::line("Pareto front", front(&trade.curves))
    });

    let ends = presets().filter_map(|curve| {
        let end = curve.points.last()?;
        Some(([end.seconds, end.error], curve.name.clone()))
    });
    let over = match trade.captures {
        0 | 1 => String::new(),
        n => format!(", mean over {n}"),
    };
    Plot {
        title: format!("{}{over}: {}", trade.capture, trade.machine.words()),
        x: Axis::logarithmic("seconds of solving"),
        y: Axis::logarithmic(trade.measure.label()),
        series,
        labels: ends.collect(),
        ..Plot::default()
    }
}

/// The points on the front, in order of seconds.
fn front(curves: &[Curve]) -> Vec<[f64; 2]> {
    let all = curves.iter().flat_map(|curve| &curve.points);
    let front = all.filter(|point| point.pareto);
    let mut front: Vec<[f64; 2]> = front.map(|p| [p.seconds, p.error]).collect();
    front.sort_by(|a, b| a[0].total_cmp(&b[0]));
    front
}
