//! Progress of a solve: a bar on a terminal, otherwise a line every few seconds; and of photographs that are written.

use crate::cli::interrupt::Interrupt;
use crate::error::Result;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{LossPoint, Progress};
use crate::say;
use crate::session::photographs::Photographs;
use crate::session::rates::Rates;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Time between two lines without a terminal.
const LINE: Duration = Duration::from_secs(3);
/// Time between two updates of the bar.
const FRAME: Duration = Duration::from_millis(100);
/// Steps of a progress bar.
pub const LENGTH: u64 = 1000;

/// A progress bar of [`LENGTH`] steps on stderr, hidden unless that is a terminal.
pub fn bar(template: &str) -> ProgressBar {
    let target = match std::io::stderr().is_terminal() {
        true => ProgressDrawTarget::stderr(),
        false => ProgressDrawTarget::hidden(),
    };
    let style = ProgressStyle::with_template(template);
    ProgressBar::with_draw_target(Some(LENGTH), target)
        .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

#[derive(Debug)]
pub struct Meter {
    bar: ProgressBar,
    shown: Option<Instant>,
    phase: String,
    rates: Rates,
}

impl Meter {
    /// A bar if stderr is a terminal, else lines.
    pub fn new() -> Self {
        Self {
            bar: bar("{bar:24} {msg}"),
            shown: None,
            phase: String::new(),
            rates: Rates::default(),
        }
    }

    /// Shows the progress if the last update is old enough or the phase has changed.
    pub fn show(&mut self, progress: &Progress, settings: &Settings) {
        self.rates.note(progress);
        let pause = if self.bar.is_hidden() { LINE } else { FRAME };
        let due = self.shown.is_none_or(|at| at.elapsed() >= pause);
        if !due && progress.phase == self.phase {
            return;
        }
        self.shown = Some(Instant::now());
        self.phase.clone_from(&progress.phase);
        let line = self.line(progress, settings);
        if self.bar.is_hidden() {
            return say::note(line);
        }
        let done = match progress.fraction {
            _ if settings.time > 0.0 => progress.seconds / settings.time,
            Some(fraction) => f64::from(fraction),
            None => 0.0,
        };
        (self.bar).set_position((done.clamp(0.0, 1.0) * LENGTH as f64) as u64);
        self.bar.set_message(line);
    }

    /// Prints a line without breaking the bar.
    pub fn say(&self, line: &str) {
        self.bar.suspend(|| say::note(line));
    }

    /// Removes the bar, so that other output can follow.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn line(&self, progress: &Progress, settings: &Settings) -> String {
        let mut line = format!("{:6.1} s  {}", progress.seconds, progress.phase);
        if let Some(fraction) = progress.fraction {
            line += &format!(" {:.0} %", fraction * 100.0);
        }
        if progress.iterations > 0 {
            line += &format!(", {} iterations", progress.iterations);
        }
        let last =
            |value: fn(&LossPoint) -> Option<f64>| progress.losses.iter().rev().find_map(value);
        if let Some(train) = last(|point| point.train) {
            line += &format!(", loss {train:.4}");
        }
        if let Some(held_out) = last(|point| point.held_out) {
            line += &format!(", held out {held_out:.4}");
        }
        if self.rates.rays() > 0.0 {
            line += &format!(", {:.2} M rays/s", self.rates.rays() * 1e-6);
        }
        if let Some(left) = self.rates.seconds_left(progress, settings) {
            line += &format!(", {left:.0} s left");
        }
        line
    }
}

/// Writes photographs with a progress bar and prints the paths of their files; Ctrl-C stops after the last complete one. Returns
/// the exit code.
pub fn write_with_progress(work: &Photographs, prefix: &dyn Fn(usize) -> PathBuf) -> Result<i32> {
    let interrupt = Interrupt::listen()?;
    let bar = bar("{bar:24} photograph {msg}, {eta} left");
    let written = work.write(prefix, &|doing| {
        bar.set_position((f64::from(doing.fraction) * LENGTH as f64) as u64);
        bar.set_message(format!("{:03}", doing.frame));
        !interrupt.requested()
    });
    bar.finish_and_clear();
    let written = written?;
    for warning in &written.warnings {
        say::warning(warning);
    }
    let (done, all) = (written.photographs, work.frames.len());
    if done < all {
        say::note(format_args!(
            "interrupted after {done} of {all} photographs"
        ));
    }
    for path in &written.files {
        say::line(path.display());
    }
    Ok(interrupt.exit_code())
}
