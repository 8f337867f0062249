//! A measurement on a thread of its own.

use crate::error::{Error, Result};
use crate::inverse::settings::Settings;
use crate::inverse::solver::Problem;
use crate::session::snapshot::OpenCapture;
use crate::study::trade::{Curve, Heard, Trade, measure, plan};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A measurement under way.
pub struct Measuring {
    capture: Arc<OpenCapture>,
    course: Arc<Course>,
    thread: Option<JoinHandle<Result<()>>>,
}

/// What the thread tells and hears.
#[derive(Default)]
struct Course {
    cancelled: AtomicBool,
    doing: Mutex<String>,
    newest: Mutex<Option<Arc<Trade>>>,
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
        wake: impl Fn() + Send + 'static,
    ) -> Result<Self> {
        let course = Arc::new(Course::default());
        let (shared, subject) = (course.clone(), capture.clone());
        let thread = std::thread::Builder::new()
            .name("trade".to_owned())
            .spawn(move || {
                let limit = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
                let end = shared.run(&subject, seed, limit, &wake);
                wake();
                end
            })
            .map_err(|error| Error::new("trade", error, "close other programs and try again"))?;
        Ok(Self {
            capture,
            course,
            thread: Some(thread),
        })
    }

    /// What is measured.
    pub fn capture(&self) -> &Arc<OpenCapture> {
        &self.capture
    }

    /// Asks it to end soon.
    pub fn cancel(&self) {
        self.course.cancelled.store(true, Ordering::Relaxed);
    }

    /// What it is at, in words.
    pub fn doing(&self) -> String {
        let doing = self.course.doing.lock();
        doing.unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// What was measured since the last call, all curves so far.
    pub fn newest(&self) -> Option<Arc<Trade>> {
        let newest = self.course.newest.lock();
        newest.unwrap_or_else(PoisonError::into_inner).take()
    }

    /// How it ended, once it has; to be asked after [`Measuring::newest`].
    pub fn ended(&mut self) -> Option<std::result::Result<(), String>> {
        let thread = self.thread.take_if(|thread| thread.is_finished())?;
        Some(match thread.join() {
            Ok(end) => end.map_err(|error| error.to_string()),
            Err(_) => Err("trade: internal error; measure again".to_owned()),
        })
    }
}

impl Drop for Measuring {
    fn drop(&mut self) {
        self.cancel();
    }
}

impl Course {
    fn run(
        &self,
        capture: &OpenCapture,
        seed: u64,
        limit: Duration,
        wake: &dyn Fn(),
    ) -> Result<()> {
        let say = |doing: String| {
            *self.doing.lock().unwrap_or_else(PoisonError::into_inner) = doing;
            wake();
        };
        say("reading the truth, if there is one".to_owned());
        let judge = capture.judge()?;
        let problem = Problem {
            scene: capture.scene.clone(),
            photographs: capture.photographs.clone(),
        };
        let runs = plan::presets(&Settings {
            seed,
            ..Settings::default()
        });
        let begun = Instant::now();
        let mut curves: Vec<Curve> = Vec::new();
        let mut tell = |heard: Heard| match heard {
            Heard::Begins(run) => say(format!("measuring {}", run.name)),
            Heard::Ended(curve) => {
                curves.push(curve.clone());
                let trade = Trade::new(
                    &capture.name,
                    Some(capture.hash.clone()),
                    judge.measure(),
                    begun.elapsed(),
                    curves.clone(),
                );
                let newest = &mut *self.newest.lock().unwrap_or_else(PoisonError::into_inner);
                *newest = Some(Arc::new(trade));
                wake();
            }
        };
        let cancelled = || self.cancelled.load(Ordering::Relaxed);
        measure(&problem, &judge, &runs, limit, &cancelled, &mut tell)?;
        Ok(())
    }
}
