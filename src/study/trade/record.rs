//! A measurement of error over time: trade.json, trade.csv and trade.png, and as text.

use crate::error::{Error, Result};
use crate::export::atomic::write_bytes;
use crate::export::table::Table;
use crate::study::machine::Machine;
use crate::study::trade::curve::{Curve, Measure, Point};
use crate::study::trade::{compare, plot};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Duration;

/// The file with all data.
const JSON: &str = "trade.json";
/// Largest trade.json that is read, in bytes.
const MAX_BYTES: u64 = 1 << 28;

/// Columns of trade.csv; the last three are constant.
const COLUMNS: &str = "curve,preset,seconds,error,error_low,error_high,reported_error,rays,iterations,pareto,measure,threads,cpu";

/// Measured curves of error over time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trade {
    /// The program's version.
    pub relit: String,
    /// Name of the capture, or of the generated rooms.
    pub capture: String,
    /// Hash of the capture's content; `None` for generated rooms.
    pub hash: Option<String>,
    /// The machine of the measurement.
    pub machine: Machine,
    /// Random seed of the solves.
    pub seed: u64,
    /// Number of captures over which points are means.
    pub captures: u64,
    /// The quantity that is measured as the error.
    pub measure: Measure,
    /// Duration of the measurement in seconds.
    pub seconds: f64,
    /// One curve for each solve.
    pub curves: Vec<Curve>,
    /// Conclusions, each a sentence.
    pub findings: Vec<String>,
}

impl Trade {
    /// A trade of one capture from its curves, in the order of [`super::plan`]. Marks the Pareto front and draws conclusions.
    pub fn new(
        capture: &str,
        hash: Option<String>,
        measure: Measure,
        elapsed: Duration,
        mut curves: Vec<Curve>,
    ) -> Self {
        mark_front(&mut curves);
        let findings = match measure {
            Measure::Albedo => compare::against_paper(&curves),
            Measure::HeldOut => Vec::new(),
        };
        Self {
            relit: env!("CARGO_PKG_VERSION").to_owned(),
            capture: capture.to_owned(),
            hash,
            machine: Machine::here(),
            seed: curves.first().map_or(0, |curve| curve.settings.seed),
            captures: 1,
            measure,
            seconds: elapsed.as_secs_f64(),
            curves,
            findings,
        }
    }

    /// Writes trade.json, trade.csv and trade.png into a folder.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        plot::plot(self).write(&folder.join("trade.png"))?;
        self.table().write(&folder.join("trade.csv"))?;
        let path = folder.join(JSON);
        let text = serde_json::to_string_pretty(self)
            .map_err(|error| Error::file(&path, error, "nothing was written there"))?;
        write_bytes(&path, text.as_bytes())
    }

    /// Reads trade.json from a folder; `None` if it does not exist.
    ///
    /// # Errors
    /// The file cannot be read or is no trade.json of this version.
    pub fn read(folder: &Path) -> Result<Option<Self>> {
        let path = folder.join(JSON);
        let length = match path.metadata() {
            Ok(metadata) => metadata.len(),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(Error::io(&path, &error)),
        };
        let measure_again = "measure again with relit trade";
        if length > MAX_BYTES {
            return Err(Error::file(&path, "is too long", measure_again));
        }
        let bytes = std::fs::read(&path).map_err(|error| Error::io(&path, &error))?;
        let trade = serde_json::from_slice(&bytes);
        let trade = trade.map_err(|error| Error::file(&path, error, measure_again))?;
        Ok(Some(trade))
    }

    /// The table, one row for each point.
    pub fn table(&self) -> Table {
        let mut table = Table::new(COLUMNS);
        for curve in &self.curves {
            for point in &curve.points {
                table.row((
                    &curve.name,
                    curve.settings.preset.word(),
                    point.seconds,
                    point.error,
                    point.spread.map(|s| s[0]),
                    point.spread.map(|s| s[1]),
                    point.reported,
                    point.rays,
                    point.iterations,
                    u8::from(point.pareto),
                    self.measure.label(),
                    self.machine.threads,
                    &self.machine.cpu,
                ));
            }
        }
        table
    }

    /// A table of the first and last point of each solve, then the conclusions.
    pub fn words(&self) -> String {
        let names = self.curves.iter().map(|curve| curve.name.chars().count());
        let width = names.max().unwrap_or(0).max(5);
        let mut text = format!("{}, {}\n", self.capture, self.machine.words());
        text += &format!(
            "{:width$}  {:>8}  {:>10}  {:>8}  {:>10}  {:>21}  {:>9}  {:>8}  front\n",
            "solve", "first s", "error", "end s", "error", "one deviation", "claimed", "M rays"
        );
        for curve in &self.curves {
            text += &line(curve, width);
        }
        for finding in &self.findings {
            text += &format!("{finding}\n");
        }
        text
    }
}

fn line(curve: &Curve, width: usize) -> String {
    let Some((first, last)) = curve.points.first().zip(curve.points.last()) else {
        return format!("{:width$}  no estimate in its time\n", curve.name);
    };
    let spread = last.spread.map_or(String::new(), |[low, high]| {
        format!("{low:.5} to {high:.5}")
    });
    let claimed = last
        .reported
        .map_or("-".to_owned(), |claim| format!("{:.2} %", claim * 100.0));
    format!(
        "{:width$}  {:>8.2}  {:>10.5}  {:>8.2}  {:>10.5}  {spread:>21}  {claimed:>9}  {:>8.1}  {}\n",
        curve.name,
        first.seconds,
        first.error,
        last.seconds,
        last.error,
        last.rays as f64 * 1e-6,
        if last.pareto { "yes" } else { "" }
    )
}

/// Marks the Pareto front: the points of all curves that no other point dominates: none is as early and as accurate, and better in
/// one of the two. Of equal points only the first is marked.
fn mark_front(curves: &mut [Curve]) {
    let points = curves.iter_mut().flat_map(|curve| &mut curve.points);
    let mut points: Vec<&mut Point> = points.collect();
    // The sort is stable: equal points stay in order.
    points.sort_by(|p, q| {
        let earlier = p.seconds.total_cmp(&q.seconds);
        earlier.then(p.error.total_cmp(&q.error))
    });
    let mut best = f64::INFINITY;
    for point in points {
        point.pareto = point.error < best;
        if point.pareto {
            best = point.error;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::settings::Preset;
    use crate::math::rng::Stream;

    #[test]
    fn a_point_is_on_the_front_exactly_if_no_other_beats_it() {
        let mut stream = Stream::new(1, 0, 0, 0);
        for count in 0..60 {
            // Few distinct values, so that many are equal.
            let points: Vec<[f64; 2]> = (0..count)
                .map(|_| [0, 1].map(|_| stream.below(9) as f64))
                .collect();
            let mut curves = [Curve::through(Preset::Balanced, &points)];
            mark_front(&mut curves);
            for (i, p) in points.iter().enumerate() {
                let beaten = points.iter().enumerate().any(|(j, q)| {
                    let as_good = q[0] <= p[0] && q[1] <= p[1];
                    as_good && (q != p || j < i)
                });
                assert_eq!(curves[0].points[i].pareto, !beaten, "{i} of {points:?}");
            }
        }
    }
}
