//! A trade as text: a line for each curve, and the conclusions.

use crate::study::trade::curve::Curve;
use crate::study::trade::record::Trade;

impl Trade {
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
