//! Runs solves one after the other and measures the error of each over time.

use crate::calibrate::problem::Problem;
use crate::error::Result;
use crate::inverse::estimate::{Estimate, ObjectEstimate};
use crate::inverse::solve;
use crate::inverse::solver::{Control, Observer, Progress, Solution, Termination};
use crate::study::trade::curve::{Curve, Point};
use crate::study::trade::metric::{ErrorOf, Metric};
use crate::study::trade::plan::Run;
use std::time::{Duration, Instant};

/// Progress of [`measure`].
#[derive(Debug)]
pub enum SolveEvent<'a> {
    /// A solve begins.
    Begins(&'a Run),
    /// A solve has ended.
    Ended(&'a Curve),
}

/// Measures `runs` in turn in about `limit` of wall time, including measurements, until `stopped`. Each gets a fraction of the
/// remaining time by its weight; unused time is left to later runs.
///
/// # Errors
/// A solver cannot start.
pub fn measure(
    problem: &Problem,
    metric: &Metric,
    runs: &[Run],
    limit: Duration,
    stopped: &dyn Fn() -> bool,
    report: &mut dyn FnMut(SolveEvent),
) -> Result<Vec<Curve>> {
    let end = Instant::now() + limit;
    let mut curves = Vec::with_capacity(runs.len());
    for (index, run) in runs.iter().enumerate() {
        if stopped() {
            break;
        }
        let now = Instant::now();
        let weights: f64 = runs[index..].iter().map(|r| r.weight).sum();
        let left = end.saturating_duration_since(now);
        let fraction = left.mul_f64((run.weight / weights).clamp(0.0, 1.0));
        report(SolveEvent::Begins(run));
        let (curve, _) = watch(problem, metric, run, now + fraction, stopped)?;
        report(SolveEvent::Ended(&curve));
        curves.push(curve);
    }
    Ok(curves)
}

/// Runs one solve until it ends or `deadline` is reached. Returns its curve and solution.
///
/// # Errors
/// The solver cannot start.
pub fn watch(
    problem: &Problem,
    metric: &Metric,
    run: &Run,
    deadline: Instant,
    stopped: &dyn Fn() -> bool,
) -> Result<(Curve, Solution)> {
    let mut watch = Watch {
        error_of: metric.for_solve(problem, &run.settings),
        spacing: metric.spacing(),
        deadline,
        stopped,
        late: false,
        measured: Vec::new(),
        rejected: 0,
        points: Vec::new(),
    };
    let solution = solve(problem, &run.settings, None, &mut watch)?;

    watch.add_point(&solution.progress, &solution.estimate);
    let ended = match solution.termination {
        Termination::Cancelled if watch.late => Termination::Time,
        other => other,
    };
    let curve = Curve {
        name: run.name.clone(),
        is_preset: run.is_preset,
        settings: run.settings.clone(),
        ended: Some(ended),
        rejected: watch.rejected,
        points: watch.points,
    };
    Ok((curve, solution))
}

/// Observer that measures a running solve from time to time.
struct Watch<'a> {
    error_of: ErrorOf<'a>,
    spacing: f64,
    deadline: Instant,
    stopped: &'a dyn Fn() -> bool,
    /// Whether the deadline has passed.
    late: bool,
    /// The estimate measured last.
    measured: Vec<ObjectEstimate>,
    rejected: u64,
    points: Vec<Point>,
}

impl Watch<'_> {
    /// Adds a point for a new estimate.
    fn add_point(&mut self, progress: &Progress, estimate: &Estimate) {
        if progress.seconds_to_first_estimate.is_none() || estimate.objects == self.measured {
            return;
        }
        self.measured.clone_from(&estimate.objects);
        match (self.error_of)(estimate).filter(|error| error.is_finite()) {
            Some(error) => self.points.push(Point {
                seconds: progress.seconds,
                error,
                spread: None,
                reported: estimate.relative_error().filter(|e| e.is_finite()),
                rays: progress.rays,
                iterations: progress.iterations,
                pareto: false,
            }),
            None => self.rejected += 1,
        }
    }
}

impl Observer for Watch<'_> {
    fn observe(&mut self, progress: &Progress, estimate: &Estimate) -> Control {
        let last = self.points.last().map_or(0.0, |point| point.seconds);
        if progress.seconds >= last * self.spacing {
            self.add_point(progress, estimate);
        }
        self.late = Instant::now() >= self.deadline;
        match self.late || (self.stopped)() {
            true => Control::Stop,
            false => Control::Continue,
        }
    }
}
