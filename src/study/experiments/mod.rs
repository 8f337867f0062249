//! The paper's experiments, each rerun by one command: `relit study NAME`.
//!
//! A study is a row of [`STUDIES`], from which the command, its help and `all` come. It runs on scenes of known truth,
//! photographed in memory, or on a capture, and hands back tables, plots and what was seen, which [`Findings::write`] puts into files.

mod batch;
mod bounces;
mod box_room;
mod chair;
mod closed_form;
mod course;
mod courses;
mod estimators;
mod evenness;
mod findings;
mod furnished;
mod gradient;
mod insertion;
mod likeness;
mod mis;
mod moved;
mod objects;
mod precision;
pub mod readings;
mod sampling;
mod selection;
mod standing;
mod subject;
mod summed;
mod table1;
mod textures;
mod twin;

pub use chair::chair;
pub use findings::{Findings, Grid, Summary};
pub use standing::{Cylinder, places, up};
pub use subject::Subject;

use crate::error::{Error, Result};
use crate::export::plot::Plot;
use std::time::Duration;

/// Rays of each descent in the quick form, which is there to try the program rather than to learn from.
const QUICK_RAYS: u64 = 150_000;

/// One of the paper's experiments.
#[derive(Debug, Clone, Copy)]
pub struct Study {
    /// Name on the command line and of its files.
    pub name: &'static str,
    /// What it asks.
    pub question: &'static str,
    /// Seeds that it repeats solves with where none are named.
    pub seeds: u64,
    run: fn(&Bench) -> Result<Findings>,
}

/// All studies, in the order in which `relit study all` runs them.
pub const STUDIES: &[Study] = &[
    batch::STUDY,
    mis::STUDY,
    bounces::STUDY,
    textures::STUDY,
    table1::STUDY,
    insertion::STUDY,
    precision::STUDY,
    sampling::STUDY,
    estimators::STUDY,
    readings::STUDY,
];

impl Study {
    /// Runs the study.
    ///
    /// # Errors
    /// A scene or a solver cannot be set up.
    pub fn run(&self, bench: &Bench) -> Result<Findings> {
        (self.run)(bench)
    }
}

/// What a study is run with.
pub struct Bench<'a> {
    /// Whether only to try it: fewer values, smaller scenes, work limited by rays instead of time.
    pub quick: bool,
    /// Time for all solves of the study together; scenes are photographed and losses measured beside it.
    pub time: Duration,
    /// How many seeds each solve is repeated with: 1, 2, …
    pub seeds: u64,
    /// The capture to run on instead of rooms of the study's own: `batch` and `textures` on its photographs, the others on
    /// its twin, whose truth is known.
    pub subject: Option<&'a Subject>,
    /// Hears what is being done.
    pub say: &'a dyn Fn(&str),
    /// Sees the plot that matters, as far as it has come, whenever there is more of it.
    pub show: &'a dyn Fn(Plot),
    /// Says whether the study is to end now, without a result.
    pub stopped: &'a dyn Fn() -> bool,
}

/// When a solve ends.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Rays cast.
    pub rays: u64,
    /// Seconds of its own clock.
    pub seconds: f64,
}

impl Limits {
    /// In words: "19.3 s", or "0.15 million rays" where the clock sets no limit.
    fn words(&self) -> String {
        match self.seconds.is_finite() {
            true => format!("{:.1} s", self.seconds),
            false => format!("{:.2} million rays", self.rays as f64 * 1e-6),
        }
    }
}

impl Bench<'_> {
    /// The fraction of one of `runs` solves.
    fn limits(&self, runs: usize) -> Limits {
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

    /// Says what is done next, unless the study is to end.
    fn begin(&self, what: &str) -> Result<()> {
        self.go_on()?;
        (self.say)(what);
        Ok(())
    }

    /// An error where the study is to end.
    fn go_on(&self) -> Result<()> {
        match (self.stopped)() {
            true => Err(Error::new("study", "it was ended", "start it again")),
            false => Ok(()),
        }
    }

    /// The seeds.
    fn seeds(&self) -> std::ops::RangeInclusive<u64> {
        1..=self.seeds
    }
}
