//! A study: its description, its options, and the files of its results.

use crate::error::{Error, Result};
use crate::export::atomic::write_bytes;
use crate::export::plot::Plot;
use crate::study::experiments::findings::Findings;
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
