//! Iterations and rays per second, and the remaining time.

use crate::inverse::settings::Settings;
use crate::inverse::solver::Progress;
use std::collections::VecDeque;

/// Seconds of solving over which rates are measured.
const WINDOW: f64 = 1.0;

/// Counters over about the last second of solving.
#[derive(Debug, Default)]
pub struct Rates {
    marks: VecDeque<Mark>,
}

#[derive(Debug, Clone, Copy)]
struct Mark {
    seconds: f64,
    iterations: u64,
    rays: u64,
}

impl Rates {
    /// Records the progress of a solve. Ignores a pause; restarts with a new solve.
    pub fn note(&mut self, progress: &Progress) {
        let mark = Mark {
            seconds: progress.seconds,
            iterations: progress.iterations,
            rays: progress.rays,
        };
        if let Some(last) = self.marks.back() {
            if mark.seconds < last.seconds || mark.iterations < last.iterations {
                self.marks.clear();
            } else if mark.seconds == last.seconds {
                return;
            }
        }
        self.marks.push_back(mark);
        let is_old = |second: &Mark| mark.seconds - second.seconds >= WINDOW;
        while self.marks.get(1).is_some_and(is_old) {
            self.marks.pop_front();
        }
    }

    pub fn iterations(&self) -> f64 {
        self.rate(|mark| mark.iterations)
    }

    pub fn rays(&self) -> f64 {
        self.rate(|mark| mark.rays)
    }

    fn rate(&self, count: impl Fn(&Mark) -> u64) -> f64 {
        match (self.marks.front(), self.marks.back()) {
            (Some(first), Some(last)) if last.seconds > first.seconds => {
                count(last).saturating_sub(count(first)) as f64 / (last.seconds - first.seconds)
            }
            _ => 0.0,
        }
    }

    /// Seconds until a limit of the settings ends the solve; `None` without a limit. It may converge earlier.
    pub fn seconds_left(&self, progress: &Progress, settings: &Settings) -> Option<f64> {
        let by_time = (settings.time > 0.0).then(|| (settings.time - progress.seconds).max(0.0));
        let rate = self.iterations();
        let by_steps = (settings.steps > 0 && rate > 0.0)
            .then(|| settings.steps.saturating_sub(progress.iterations) as f64 / rate);
        by_time.into_iter().chain(by_steps).reduce(f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64, iterations: u64) -> Progress {
        Progress {
            seconds,
            iterations,
            rays: 1000 * iterations,
            ..Default::default()
        }
    }

    #[test]
    fn rates_cover_the_last_second_and_forget_an_earlier_solve() {
        let mut rates = Rates::default();
        for i in 0..=40u32 {
            // 10 iterations a second for two seconds, then 100.
            let seconds = f64::from(i) * 0.1;
            let iterations = if i <= 20 { i } else { 20 + (i - 20) * 10 };
            rates.note(&at(seconds, u64::from(iterations)));
        }
        assert!((rates.iterations() - 100.0).abs() < 1.0, "{rates:?}");
        assert!((rates.rays() - 100_000.0).abs() < 1000.0);
        let settings = Settings {
            time: 10.0,
            steps: 320,
            ..Default::default()
        };
        let left = rates.seconds_left(&at(4.0, 220), &settings);
        assert!(left.is_some_and(|s| (s - 1.0).abs() < 0.05), "{left:?}");
        rates.note(&at(0.0, 0));
        assert_eq!(rates.iterations(), 0.0);
        assert_eq!(rates.seconds_left(&at(0.0, 0), &Settings::default()), None);
    }
}
