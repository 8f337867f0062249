//! The solver's clock and its reports to the observer.

use crate::inverse::estimate::Estimate;
use crate::inverse::known::Known;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{
    Checkpoint, Control, FitPoint, LossPoint, Observer, Progress, Termination, TexturePoint,
};
use crate::transport::arrival::RayCount;
use std::time::{Duration, Instant};

/// Measures solving time without pauses, reports to the observer, and decides when to stop.
pub struct Monitor<'a> {
    observer: &'a mut dyn Observer,
    /// The progress that is reported.
    pub progress: Progress,
    /// The present settings; live ones may change at any report.
    pub settings: Settings,
    /// Values that are held fixed.
    pub known: Known,
    started: Instant,
    /// Time spent in the observer.
    away: Duration,
    /// Seconds of earlier runs.
    earlier: f64,
    last_report: Option<Instant>,
}

const REPORT_EVERY: Duration = Duration::from_millis(30);
/// Least seconds between points of the curve of textures, so that a thousand objects leave some hundred.
const TEXTURE_EVERY: f64 = 0.25;

impl<'a> Monitor<'a> {
    /// Starts the clock at the seconds in `progress`.
    pub fn new(settings: &Settings, observer: &'a mut dyn Observer, progress: Progress) -> Self {
        Self {
            known: observer.known(),
            observer,
            earlier: progress.seconds,
            progress,
            settings: settings.clone(),
            started: Instant::now(),
            away: Duration::ZERO,
            last_report: None,
        }
    }

    /// Seconds of solving so far.
    pub fn seconds(&self) -> f64 {
        self.earlier + (self.started.elapsed().saturating_sub(self.away)).as_secs_f64()
    }

    /// Whether a report is due.
    pub fn due(&self) -> bool {
        self.last_report
            .is_none_or(|at| at.elapsed() >= REPORT_EVERY)
    }

    /// Reports to the observer if a report is due.
    ///
    /// # Errors
    /// The reason to end the solve.
    pub fn tick(
        &mut self,
        estimate: &Estimate,
        checkpoint: &dyn Fn(&Progress) -> Checkpoint,
    ) -> Result<(), Termination> {
        if self.due() {
            self.report(estimate, checkpoint)?;
        }
        Ok(())
    }

    /// Reports to the observer, and applies its answer and the limits of time and error. `checkpoint` is called only if the
    /// observer keeps one.
    ///
    /// # Errors
    /// The reason to end the solve.
    pub fn report(
        &mut self,
        estimate: &Estimate,
        checkpoint: &dyn Fn(&Progress) -> Checkpoint,
    ) -> Result<(), Termination> {
        self.progress.seconds = self.seconds();
        let called = Instant::now();
        let progress = &self.progress;
        self.observer.offer(&|| checkpoint(progress));
        let control = self.observer.observe(&self.progress, estimate);
        self.away += called.elapsed();
        self.last_report = Some(Instant::now());
        match control {
            Control::Continue => {}
            Control::Change(settings) => self.settings = *settings,
            Control::Stop => return Err(Termination::Cancelled),
        }
        if self.settings.time > 0.0 && self.seconds() >= self.settings.time {
            return Err(Termination::Time);
        }
        let target = self.settings.target_error;
        if target > 0.0 && self.reported_error(estimate) <= target {
            return Err(Termination::Target);
        }
        Ok(())
    }

    /// An estimate's reported error in percent; infinite before the first estimate.
    fn reported_error(&self, estimate: &Estimate) -> f64 {
        let first = self.progress.seconds_to_first_estimate;
        let error = first.and_then(|_| estimate.relative_error());
        error.map_or(f64::INFINITY, |error| error * 100.0)
    }

    /// Sets the name of the present phase.
    pub fn phase(&mut self, name: &str) {
        name.clone_into(&mut self.progress.phase);
        self.progress.fraction = None;
    }

    /// Adds a point to the loss curve.
    pub fn loss(&mut self, train: Option<f64>, held_out: Option<f64>) {
        let point = LossPoint {
            seconds: self.seconds(),
            iteration: self.progress.iterations,
            train,
            held_out,
        };
        self.progress.losses.push(point);
    }

    /// Adds a point to the curve of the fit: the relative residual, the number of free unknowns, and the reported error.
    pub fn fitted(&mut self, residual: f64, unknowns: usize, estimate: &Estimate) {
        let point = FitPoint {
            seconds: self.seconds(),
            iteration: self.progress.iterations,
            residual,
            stderr: estimate.relative_error(),
            unknowns: unknowns as u64,
        };
        self.progress.fits.push(point);
    }

    /// Adds a point to the curve of textures, unless the last one is new.
    pub fn texture(&mut self, residual: f64) {
        let seconds = self.seconds();
        let last = self.progress.textures.last();
        if last.is_none_or(|last| seconds - last.seconds >= TEXTURE_EVERY) {
            let iteration = self.progress.iterations;
            self.progress.textures.push(TexturePoint {
                seconds,
                iteration,
                residual,
            });
        }
    }

    /// Counts rays cast, and paths rejected because their weights were not finite.
    pub fn cast(&mut self, cast: RayCount) {
        self.progress.rays += cast.rays;
        self.rejected("path weight not finite", cast.rejected);
    }

    /// Counts rejected samples by cause.
    pub fn rejected(&mut self, cause: &str, count: u64) {
        if count > 0 {
            *self.progress.rejected.entry(cause.to_owned()).or_default() += count;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inverse::estimate::{ENOUGH_PIXELS, ObjectEstimate};
    use glam::Vec3;

    /// Gives a fixed answer after a pause.
    struct Puppet(Control, Duration);

    impl Observer for Puppet {
        fn observe(&mut self, _: &Progress, _: &Estimate) -> Control {
            std::thread::sleep(self.1);
            self.0.clone()
        }
    }

    fn puppet(answer: Control) -> Puppet {
        Puppet(answer, Duration::ZERO)
    }

    fn report(monitor: &mut Monitor) -> Result<(), Termination> {
        monitor.report(&Estimate::default(), &|progress| {
            Checkpoint::new(progress, &())
        })
    }

    #[test]
    fn answers_are_obeyed() {
        let settings = Settings::default();
        let mut observer = puppet(Control::Stop);
        let mut monitor = Monitor::new(&settings, &mut observer, Progress::default());
        let stopped = report(&mut monitor);
        assert_eq!(stopped, Err(Termination::Cancelled));

        let changed = Settings {
            batch: 99,
            ..settings.clone()
        };
        let mut observer = puppet(Control::Change(Box::new(changed)));
        let mut monitor = Monitor::new(&settings, &mut observer, Progress::default());
        assert_eq!(report(&mut monitor), Ok(()));
        assert_eq!(monitor.settings.batch, 99);
    }

    #[test]
    fn earlier_runs_count_towards_the_time_limit() {
        let settings = Settings {
            time: 100.0,
            ..Settings::default()
        };
        for (earlier, end) in [(0.0, Ok(())), (100.0, Err(Termination::Time))] {
            let progress = Progress {
                seconds: earlier,
                ..Progress::default()
            };
            let mut observer = puppet(Control::Continue);
            let mut monitor = Monitor::new(&settings, &mut observer, progress);
            assert_eq!(report(&mut monitor), end);
            assert!(monitor.progress.seconds >= earlier);
        }
    }

    #[test]
    fn a_target_ends_the_solve_once_the_first_estimate_claims_it() {
        let settings = Settings {
            target_error: 2.0,
            ..Settings::default()
        };
        let object = |stderr| ObjectEstimate {
            albedo: Vec3::splat(0.5),
            albedo_stderr: Vec3::splat(stderr),
            seen_pixels: ENOUGH_PIXELS,
            ..ObjectEstimate::default()
        };
        let estimate = Estimate {
            objects: vec![object(0.2), object(0.009), object(0.001)],
            ..Estimate::default()
        };
        let mut observer = puppet(Control::Continue);
        let mut monitor = Monitor::new(&settings, &mut observer, Progress::default());
        let mut ends = |first, target_error| {
            monitor.progress.seconds_to_first_estimate = first;
            monitor.settings.target_error = target_error;
            monitor.report(&estimate, &|progress| Checkpoint::new(progress, &()))
        };
        assert_eq!(ends(None, 2.0), Ok(()));
        assert_eq!(ends(Some(1.0), 1.0), Ok(()));
        assert_eq!(ends(Some(1.0), 2.0), Err(Termination::Target));
        assert_eq!(ends(Some(1.0), 0.0), Ok(()));
    }

    #[test]
    fn the_observers_time_is_not_the_solvers() {
        let pause = Duration::from_millis(50);
        let begun = Instant::now();
        let mut observer = Puppet(Control::Continue, pause);
        let mut monitor = Monitor::new(&Settings::default(), &mut observer, Progress::default());
        assert!(monitor.due());
        assert_eq!(report(&mut monitor), Ok(()));
        let seconds = monitor.seconds();
        assert!(seconds <= (begun.elapsed() - pause).as_secs_f64());
    }
}
