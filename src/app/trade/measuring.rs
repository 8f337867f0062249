//! Measuring on a thread of its own.

use crate::app::task::{Progress, Task};
use crate::error::Result;
use crate::inverse::settings::Settings;
use crate::session::snapshot::OpenCapture;
use crate::study::trade::{Curve, SolveEvent, Trade, measure, plan};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A measurement under way.
pub struct Measuring {
    /// What is measured.
    pub capture: Arc<OpenCapture>,
    /// The work; shows all curves so far.
    pub task: Task<Arc<Trade>, ()>,
}

impl Measuring {
    /// Begins; `wake` is called after every change.
    ///
    /// # Errors
    /// The system grants no thread.
    pub fn begin(
        capture: Arc<OpenCapture>,
        seed: u64,
        seconds: f64,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> Result<Self> {
        let measured = capture.clone();
        let limit = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
        let run = move |progress: &Progress<_>| run(progress, &measured, seed, limit);
        let task = Task::begin("trade", wake, run)?;
        Ok(Self { capture, task })
    }
}

fn run(
    progress: &Progress<Arc<Trade>>,
    capture: &OpenCapture,
    seed: u64,
    limit: Duration,
) -> Result<()> {
    progress.say("reading the truth, if there is one");
    let subject = capture.subject()?;
    let runs = plan::presets(&Settings {
        seed,
        ..Settings::default()
    });
    let (begun, hash, metric) = (Instant::now(), &capture.hash, &subject.metric);
    let mut curves: Vec<Curve> = Vec::new();
    let mut tell = |heard: SolveEvent| match heard {
        SolveEvent::Begins(run) => progress.say(format!("measuring {}", run.name)),
        SolveEvent::Ended(curve) => {
            curves.push(curve.clone());
            let (hash, measure, curves) = (Some(hash.clone()), metric.measure(), curves.clone());
            let trade = Trade::new(&subject.name, hash, measure, begun.elapsed(), curves);
            progress.show(Arc::new(trade));
        }
    };
    let ended = || progress.is_cancelled();
    measure(&subject.problem, metric, &runs, limit, &ended, &mut tell)?;
    Ok(())
}
