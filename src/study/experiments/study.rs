//! A study: its description, its options, and its results with their files: NAME.csv, NAME.png, NAME.md and others.

use crate::error::{Error, Result};
use crate::export::atomic::write_bytes;
use crate::export::compare::write_grid;
use crate::export::plot::Plot;
use crate::export::table::Table;
use crate::math::picture::Picture;
use crate::study::machine::Machine;
use crate::study::subject::Subject;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Rays of each descent with `quick`, which only tries the program.
const QUICK_RAYS: u64 = 150_000;

/// One of the paper's experiments.
#[derive(Debug, Clone, Copy)]
pub struct Study {
    /// Name on the command line and of its files.
    pub name: &'static str,
    /// The question that it answers.
    pub question: &'static str,
    /// Default number of seeds.
    pub seeds: u64,
    /// The function that runs it.
    pub(super) run: fn(&Bench) -> Result<Findings>,
}

impl Study {
    /// Runs the study.
    ///
    /// # Errors
    /// A scene or a solver cannot be set up.
    pub fn run(&self, bench: &Bench) -> Result<Findings> {
        (self.run)(bench)
    }
}

/// Context and options of a study.
pub struct Bench<'a> {
    /// Only try the program: fewer values, smaller scenes, limits in rays instead of time.
    pub quick: bool,
    /// Time for all solves together, without rendering photographs and measuring losses.
    pub time: Duration,
    /// Number of seeds that each solve is repeated with: 1, 2, …
    pub seeds: u64,
    /// The capture to run on instead of the study's own rooms: `batch` and `textures` use its photographs, the others
    /// its twin, whose truth is known.
    pub subject: Option<&'a Subject>,
    /// Called with a description of the next step.
    pub say: &'a dyn Fn(&str),
    /// Called with the main plot whenever it grows.
    pub show: &'a dyn Fn(Plot),
    /// Returns whether the study is to stop without a result.
    pub stopped: &'a dyn Fn() -> bool,
}

/// Limits of a solve.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Rays cast.
    pub rays: u64,
    /// Seconds of solving.
    pub seconds: f64,
}

impl Limits {
    /// As text: "19.3 s", or "0.15 million rays" without a time limit.
    pub(super) fn words(&self) -> String {
        match self.seconds.is_finite() {
            true => format!("{:.1} s", self.seconds),
            false => format!("{:.2} million rays", self.rays as f64 * 1e-6),
        }
    }
}

impl Bench<'_> {
    /// The limits of each of `runs` solves.
    pub(super) fn limits(&self, runs: usize) -> Limits {
        if self.quick {
            return Limits {
                rays: QUICK_RAYS,
                seconds: f64::INFINITY,
            };
        }
        Limits {
            rays: u64::MAX,
            seconds: self.time.as_secs_f64() / runs.max(1) as f64,
        }
    }

    /// Announces the next step, unless the study is stopped.
    pub(super) fn begin(&self, what: &str) -> Result<()> {
        self.go_on()?;
        (self.say)(what);
        Ok(())
    }

    /// An error if the study is stopped.
    pub(super) fn go_on(&self) -> Result<()> {
        match (self.stopped)() {
            true => Err(Error::new("study", "it was stopped", "start it again")),
            false => Ok(()),
        }
    }

    /// The seeds of the repeated solves.
    pub(super) fn seeds(&self) -> std::ops::RangeInclusive<u64> {
        1..=self.seeds
    }
}

/// Results of a study. The first string of each pair is a suffix to the study's name in the file name, such as `-rays`,
/// or empty.
#[derive(Debug, Clone, Default)]
pub struct Findings {
    /// What was run, in sentences.
    pub how: String,
    /// Every value measured.
    pub tables: Vec<(&'static str, Table)>,
    /// Plots of the values.
    pub plots: Vec<(&'static str, Plot)>,
    /// Table of the most important values.
    pub summary: Summary,
    /// Conclusions, each of a sentence or two.
    pub seen: Vec<String>,
    /// Pictures side by side.
    pub pictures: Vec<(&'static str, Grid)>,
}

impl Findings {
    /// Writes all files into a folder and returns their paths.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(&self, study: &Study, folder: &Path) -> Result<Vec<PathBuf>> {
        let mut written = Vec::new();
        let mut file = |suffix: &str, ending: &str| {
            let path = folder.join(format!("{}{suffix}.{ending}", study.name));
            written.push(path.clone());
            path
        };
        for (suffix, table) in &self.tables {
            table.write(&file(suffix, "csv"))?;
        }
        for (suffix, plot) in &self.plots {
            plot.write(&file(suffix, "png"))?;
        }
        for (suffix, grid) in &self.pictures {
            grid.write(&file(suffix, "png"))?;
        }
        write_bytes(&file("", "md"), self.markdown(study).as_bytes())?;
        Ok(written)
    }

    /// The report in Markdown.
    pub fn markdown(&self, study: &Study) -> String {
        let mut text = format!("# {}\n\n{}\n\n", study.name, study.question);
        text += &format!("{} Machine: {}.\n\n", self.how, Machine::here().words());
        text += &self.summary.markdown();
        text += "\n## Seen\n\n";
        for sentence in &self.seen {
            text += &format!("* {sentence}\n");
        }
        text += "\n";
        let plots = self.plots.iter().map(|(suffix, _)| suffix);
        for suffix in plots.chain(self.pictures.iter().map(|(suffix, _)| suffix)) {
            text += &format!("![{0}{suffix}]({0}{suffix}.png)\n\n", study.name);
        }
        let tables: Vec<String> = (self.tables.iter())
            .map(|(suffix, _)| format!("[{0}{suffix}.csv]({0}{suffix}.csv)", study.name))
            .collect();
        text + &format!("Every value: {}\n", tables.join(", "))
    }
}

/// A grid of pictures with captions, all at the same exposure.
#[derive(Debug, Clone)]
pub struct Grid {
    /// Pictures in a row.
    pub columns: usize,
    /// Exposure for display.
    pub exposure: f32,
    /// Captions and pictures.
    pub pictures: Vec<(String, Picture)>,
}

impl Grid {
    /// Writes the grid as a PNG.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let pictures = self.pictures.iter().map(|(name, p)| (name.as_str(), p));
        let pictures: Vec<_> = pictures.collect();
        write_grid(path, &pictures, self.columns, self.exposure)
    }
}

/// A small table of text.
#[derive(Debug, Clone, Default)]
pub struct Summary {
    /// Column titles, with ` | ` between them.
    pub columns: &'static str,
    /// Rows, one text for each column.
    pub rows: Vec<Vec<String>>,
}

impl Summary {
    /// The table in Markdown.
    pub fn markdown(&self) -> String {
        let line = |cells: &str| format!("| {cells} |\n");
        let rule = vec!["---"; self.columns.split(" | ").count()];
        let rows: String = self.rows.iter().map(|row| line(&row.join(" | "))).collect();
        line(self.columns) + &line(&rule.join(" | ")) + &rows
    }
}

/// Formats a number with three significant digits.
pub fn brief(value: f64) -> String {
    match value.abs() {
        size if size == 0.0 || !size.is_finite() => value.to_string(),
        size if (1e-4..1e4).contains(&size) => {
            let digits = (2 - size.log10().floor() as i32).max(0) as usize;
            format!("{value:.digits$}")
        }
        _ => format!("{value:.2e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::brief;

    #[test]
    fn numbers_keep_three_digits() {
        let texts = [0.0123456, 123.456, 0.5, 1234.5, 1.5e-7, 0.0, f64::NAN].map(brief);
        assert_eq!(
            texts,
            ["0.0123", "123", "0.500", "1234", "1.50e-7", "0", "NaN"]
        );
    }
}
