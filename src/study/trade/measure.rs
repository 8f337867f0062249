//! Runs the solves one after the other and watches the error of each.

use crate::calibrate::problem::Problem;
use crate::error::Result;
use crate::inverse::estimate::{Estimate, ObjectEstimate};
use crate::inverse::solve;
use crate::inverse::solver::{Control, Observer, Progress, Solution, Termination};
use crate::study::trade::judge::{Bench, Judge};
use crate::study::trade::plan::Run;
use crate::study::trade::{Curve, Point};
use std::time::{Duration, Instant};

/// What a measurement tells while it goes on.
#[derive(Debug)]
pub enum Heard<'a> {
    /// A solve begins.
    Begins(&'a Run),
    /// A solve has ended.
    Ended(&'a Curve),
}

/// Measures `runs` one after the other in about `limit` of wall time, judging included, until `stopped`; of what is
/// left each gets a fraction by its weight, and what one leaves over goes to those after it.
///
/// # Errors
/// A solver cannot start.
pub fn measure(
    problem: &Problem,
    judge: &Judge,
    runs: &[Run],
    limit: Duration,
    stopped: &dyn Fn() -> bool,
    tell: &mut dyn FnMut(Heard),
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
        tell(Heard::Begins(run));
        let (curve, _) = watch(problem, judge, run, now + fraction, stopped)?;
        tell(Heard::Ended(&curve));
        curves.push(curve);
    }
    Ok(curves)
}

/// Runs one solve until it ends or `deadline` comes; its course and what it found.
///
/// # Errors
/// The solver cannot start.
pub fn watch(
    problem: &Problem,
    judge: &Judge,
    run: &Run,
    deadline: Instant,
    stopped: &dyn Fn() -> bool,
) -> Result<(Curve, Solution)> {
    let mut watch = Watch {
        problem,
        bench: judge.bench(problem, &run.settings),
        spacing: judge.spacing(),
        deadline,
        stopped,
        late: false,
        judged: Vec::new(),
        rejected: 0,
        points: Vec::new(),
    };
    let solution = solve(problem, &run.settings, None, &mut watch)?;

    // Where it ended.
    watch.judge(&solution.progress, &solution.estimate);
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

/// Judges a running solve now and then.
struct Watch<'a> {
    problem: &'a Problem,
    bench: Bench<'a>,
    spacing: f64,
    deadline: Instant,
    stopped: &'a dyn Fn() -> bool,
    /// Whether the deadline has come.
    late: bool,
    /// What was judged last.
    judged: Vec<ObjectEstimate>,
    rejected: u64,
    points: Vec<Point>,
}

impl Watch<'_> {
    /// Adds a point for an estimate that was not judged yet.
    fn judge(&mut self, progress: &Progress, estimate: &Estimate) {
        if progress.seconds_to_first_estimate.is_none() || estimate.objects == self.judged {
            return;
        }
        self.judged.clone_from(&estimate.objects);
        let error = self.bench.error(self.problem, estimate);
        match error.filter(|error| error.is_finite()) {
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
            self.judge(progress, estimate);
        }
        self.late = Instant::now() >= self.deadline;
        if self.late || (self.stopped)() {
            return Control::Stop;
        }
        Control::Continue
    }
}
