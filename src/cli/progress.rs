//! Progress of a solve: a bar on a terminal, otherwise a line every few seconds.

use crate::inverse::settings::Settings;
use crate::inverse::solver::{LossPoint, Progress};
use crate::say;
use crate::session::rates::Rates;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
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

/// Shows progress on stderr.
#[derive(Debug)]
pub struct Meter {
    bar: Option<ProgressBar>,
    shown: Option<Instant>,
    phase: String,
    rates: Rates,
}

impl Meter {
    /// A bar if stderr is a terminal, else lines.
    pub fn new() -> Self {
        let is_terminal = std::io::stderr().is_terminal();
        Self {
            bar: is_terminal.then(|| bar("{bar:24} {msg}")),
            shown: None,
            phase: String::new(),
            rates: Rates::default(),
        }
    }

    /// Shows the progress if the last update is old enough or the phase has changed.
    pub fn show(&mut self, progress: &Progress, settings: &Settings) {
        self.rates.note(progress);
        let pause = if self.bar.is_some() { FRAME } else { LINE };
        let due = self.shown.is_none_or(|at| at.elapsed() >= pause);
        if !due && progress.phase == self.phase {
            return;
        }
        self.shown = Some(Instant::now());
        self.phase.clone_from(&progress.phase);
        let line = self.line(progress, settings);
        match &self.bar {
            Some(bar) => {
                let by_time = settings.time > 0.0;
                let done = match progress.fraction {
                    _ if by_time => progress.seconds / settings.time,
                    Some(fraction) => f64::from(fraction),
                    None => 0.0,
                };
                bar.set_position((done.clamp(0.0, 1.0) * LENGTH as f64) as u64);
                bar.set_message(line);
            }
            None => say::note(line),
        }
    }

    /// Prints a line without breaking the bar.
    pub fn say(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| say::note(line)),
            None => say::note(line),
        }
    }

    /// Removes the bar, so that other output can follow.
    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
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
