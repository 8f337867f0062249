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
            name: curve.name.clone(),
            points: points(&curve.points),
            band: (curve.points.iter()).filter_map(|p| p.spread).collect(),
            draw: Draw::Line,
        })
        .filter(|series| !series.points.is_empty())
        .collect();
    let varied = trade.curves.iter().filter(|curve| !curve.is_preset);
    let varied: Vec<[f64; 2]> = varied.flat_map(|curve| points(&curve.points)).collect();
    if !varied.is_empty() {
        series.push(Series {
            name: "one setting changed".to_owned(),
            points: varied,
            band: Vec::new(),
            draw: Draw::Dots,
        });
    }
    series.push(Series {
        name: "Pareto front".to_owned(),
        points: front(&trade.curves),
        band: Vec::new(),
        draw: Draw::Steps,
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
        marks: Vec::new(),
        labels: ends.collect(),
    }
}

/// The points on the front, in order of seconds.
pub fn front(curves: &[Curve]) -> Vec<[f64; 2]> {
    let all = curves.iter().flat_map(|curve| &curve.points);
    let mut front: Vec<[f64; 2]> = all
        .filter(|point| point.pareto)
        .map(|point| [point.seconds, point.error])
        .collect();
    front.sort_by(|a, b| a[0].total_cmp(&b[0]));
    front
}
