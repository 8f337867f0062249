//! Where single precision stops being enough.

use crate::error::Result;
use crate::export::plot::{Axis, Plot, Series};
use crate::export::table::Table;
use crate::inverse::settings::{Preset, Settings};
use crate::study::experiments::course::{cache_settings, solved};
use crate::study::experiments::findings::brief;
use crate::study::experiments::moved::{self, hit_error};
use crate::study::experiments::subject::Subject;
use crate::study::experiments::summed::Paths;
use crate::study::experiments::{Bench, Findings, Study, Summary, box_room};

/// The study.
pub const STUDY: Study = Study {
    name: "precision",
    question: "Rays and path weights are kept in 32 bits, sums in 64. Over sizes, distances from the origin, numbers of paths \
        and ratios of lamps: where is that no longer enough?",
    takes_capture: false,
    seeds: 1,
    run,
};

/// Mean albedo and half side of the lamp.
const ALBEDO: f64 = 0.5;
const LAMP: f64 = 0.25;
/// A relative error above this is too large.
const TOLERABLE: f64 = 1e-3;

/// Errors along one axis.
struct Line {
    axis: &'static str,
    quantity: &'static str,
    /// Value on the axis, and error.
    points: Vec<(f64, f64)>,
}

fn run(bench: &Bench) -> Result<Findings> {
    let step = if bench.quick { 4 } else { 1 };
    let powers = |low: i32, high: i32| -> Vec<f64> {
        (low..=high).step_by(step).map(|k| 10f64.powi(k)).collect()
    };
    let subject = box_room::photographed("box room", ALBEDO, LAMP, true)?;
    let room = box_room::box_room("box room", ALBEDO, LAMP);
    let albedos = |subject: &Subject| -> Result<Vec<f64>> {
        let settings = Settings {
            preset: Preset::Preview,
            ..cache_settings(1, bench.quick)
        };
        let objects = solved(bench, subject, &settings)?.estimate.objects;
        let reflectors = objects.iter().take(moved::REFLECTORS);
        Ok(reflectors
            .flat_map(|object| object.albedo.to_array())
            .map(f64::from)
            .collect())
    };
    let wanted = albedos(&subject)?;

    // The same room of other sizes, and with something far away.
    let mut lines = Vec::new();
    let sizes: Vec<f64> = powers(-6, 6);
    let far: Vec<f64> = powers(1, 6);
    let changed: [(&str, Vec<f64>, moved::Change); 2] = [
        ("size of the room", sizes, moved::scaled),
        ("distance of an outlier, in rooms", far, moved::with_outlier),
    ];
    for (axis, values, change) in changed {
        bench.begin(axis)?;
        let (mut hits, mut off) = (Vec::new(), Vec::new());
        for value in values {
            let (room, size) = change(&room, value);
            let photographs = subject.problem.photographs.iter().map(|p| (**p).clone());
            let other = Subject::of_photographs(&room, photographs.collect())?;
            hits.push((value, hit_error(&room, &other.problem.scene, size)));
            let found = albedos(&other)?;
            let differences = found.iter().zip(&wanted).map(|(a, b)| (a - b).abs() / b);
            off.push((value, differences.sum::<f64>() / wanted.len() as f64));
        }
        lines.push(Line {
            axis,
            quantity: "hit points, in rooms (99 % below)",
            points: hits,
        });
        lines.push(Line {
            axis,
            quantity: "albedos of a fit, against the room as it is",
            points: off,
        });
        (bench.show)(plot(&lines));
    }

    bench.begin("sums of paths")?;
    // Sums of paths, and two lamps of very unequal radiance.
    let paths = Paths::trace(
        &subject.problem,
        if bench.quick { 10_000 } else { 1_000_000 },
    );
    for (quantity, sum) in [
        (
            "one sum in 32 bits",
            Paths::in_f32 as fn(&Paths, usize) -> f64,
        ),
        ("32 bits a path, 64 in the sum", Paths::in_f64),
    ] {
        let counts = powers(1, paths.count().ilog10() as i32);
        lines.push(Line {
            axis: "paths summed",
            quantity,
            points: (counts.into_iter())
                .map(|n| (n, paths.error(n as usize, sum)))
                .collect(),
        });
    }
    let ratios = powers(0, 12).into_iter();
    lines.push(Line {
        axis: "ratio of two lamps",
        quantity: "light of the dimmer one beside the other",
        points: ratios
            .map(|ratio| (ratio, paths.of_dim_lamp(ratio)))
            .collect(),
    });
    Ok(findings(&lines))
}

fn findings(lines: &[Line]) -> Findings {
    let mut table = Table::new(&["axis", "quantity", "value", "relative_error"]);
    for line in lines {
        for &(value, error) in &line.points {
            table.row(&[
                line.axis.into(),
                line.quantity.into(),
                value.into(),
                error.into(),
            ]);
        }
    }
    let row = |line: &Line| {
        let errors = line.points.iter().map(|p| p.1);
        vec![
            line.axis.to_owned(),
            line.quantity.to_owned(),
            brief(errors.clone().fold(f64::INFINITY, f64::min)),
            brief(errors.fold(0.0, f64::max)),
            reach(line),
        ]
    };
    Findings {
        how: format!(
            "A box room of mean albedo {ALBEDO}, against the same in 64 bits: hit points of the photographs' central rays \
             against planes and cameras as given; albedos fitted by preset `preview` with the same seed to the same \
             photographs, against those of the room as it is; radiance of paths as the fit evaluates them, against the same \
             products in 64 bits. Every number is the same on every machine.",
        ),
        tables: vec![("", table)],
        plots: vec![("", plot(lines))],
        summary: Summary {
            columns: vec![
                "axis",
                "quantity",
                "least error",
                "largest error",
                "below a thousandth",
            ],
            rows: lines.iter().map(row).collect(),
        },
        seen: (lines.iter())
            .map(|line| format!("{}, {}: {}.", line.axis, line.quantity, sentence(line)))
            .collect(),
        ..Findings::default()
    }
}

fn plot(lines: &[Line]) -> Plot {
    let series = |line: &Line| Series {
        name: format!("{}: {}", line.axis, line.quantity),
        points: line.points.iter().map(|&(x, y)| [x, y]).collect(),
        ..Series::default()
    };
    Plot {
        title: "Relative errors of 32 bits".to_owned(),
        x: Axis::logarithmic("value on the axis named"),
        y: Axis::logarithmic("relative error"),
        series: lines.iter().map(series).collect(),
        ..Plot::default()
    }
}

/// From where to where an error is tolerable.
fn reach(line: &Line) -> String {
    let good = || line.points.iter().filter(|p| p.1 <= TOLERABLE).map(|p| p.0);
    match (good().reduce(f64::min), good().reduce(f64::max)) {
        (Some(low), Some(high)) => format!("{low:.0e} to {high:.0e}"),
        _ => "nowhere".to_owned(),
    }
}

fn sentence(line: &Line) -> String {
    let (Some(first), Some(last)) = (line.points.first(), line.points.last()) else {
        return "not measured".to_owned();
    };
    match line.points.iter().find(|p| p.1.is_nan() || p.1 > TOLERABLE) {
        None => format!(
            "below a thousandth everywhere from {:.0e} to {:.0e}, at most {}",
            first.0,
            last.0,
            brief(line.points.iter().map(|p| p.1).fold(0.0, f64::max)),
        ),
        Some(worse) => format!(
            "{} at {:.0e}, and above a thousandth from {:.0e} on ({})",
            brief(first.1),
            first.0,
            worse.0,
            brief(worse.1),
        ),
    }
}
