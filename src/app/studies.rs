//! The paper's experiments, run from the window: on the open capture, or on rooms of their own.

use crate::app::shell::files::file_name;
use crate::app::state::App;
use crate::app::task::{Course, Task};
use crate::error::Result;
use crate::export::plot::Plot;
use crate::session::snapshot::{Level, OpenCapture};
use crate::study::experiments::{Bench, STUDIES, Study};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// What is chosen of a study before it begins.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Which of [`STUDIES`].
    pub study: usize,
    /// Seconds for all its solves.
    pub seconds: f64,
    /// Seeds that each solve is repeated with.
    pub seeds: u64,
    /// Whether to run on rooms of the study's own, also where a capture is open.
    pub own_rooms: bool,
    /// Whether only to try it.
    pub quick: bool,
    /// The folder that its files go into, as typed; those on a capture go into a folder of its name there.
    pub folder: String,
}

impl Default for Plan {
    fn default() -> Self {
        Self {
            study: 0,
            seconds: 120.0,
            seeds: 2,
            own_rooms: false,
            quick: false,
            folder: "relit-out/studies".to_owned(),
        }
    }
}

impl Plan {
    /// The study.
    pub fn study(&self) -> &'static Study {
        &STUDIES[self.study.min(STUDIES.len() - 1)]
    }
}

/// What a study has found so far.
#[derive(Debug, Clone)]
pub struct Shown {
    /// The study.
    pub study: &'static Study,
    /// What it runs on.
    pub on: String,
    /// The plot, as far as it has come.
    pub plot: Option<Plot>,
    /// What was seen, once it has ended.
    pub seen: Vec<String>,
    /// The folder that holds its files, once they are written.
    pub folder: Option<PathBuf>,
}

/// The state of the pane.
#[derive(Default)]
pub struct StudiesView {
    /// What is begun next.
    pub plan: Plan,
    /// What is shown.
    pub shown: Option<Shown>,
    running: Option<(Task<Plot, Ended>, Instant)>,
}

/// What a study leaves.
struct Ended {
    plot: Option<Plot>,
    seen: Vec<String>,
    folder: PathBuf,
}

impl StudiesView {
    /// What is done now, in words.
    pub fn doing(&self) -> Option<String> {
        let (task, _) = self.running.as_ref()?;
        Some(match task.is_cancelled() {
            true => "ending".to_owned(),
            false => task.doing(),
        })
    }

    /// Seconds since the study began.
    pub fn seconds(&self) -> f64 {
        (self.running.as_ref()).map_or(0.0, |(_, begun)| begun.elapsed().as_secs_f64())
    }
}

impl App {
    /// Whether a study can begin or be ended: neither a solve nor a measurement runs, and what it needs is open.
    pub fn can_run_study(&self) -> bool {
        let free = !self.is_running() && self.trade.doing().is_none();
        self.studies.doing().is_some() || free
    }

    /// Begins the chosen study, or ends the one that runs.
    pub fn run_or_cancel_study(&mut self, ctx: &egui::Context) {
        if let Some((task, _)) = &self.studies.running {
            task.cancel();
            return;
        }
        if !self.can_run_study() {
            return;
        }
        let plan = self.studies.plan.clone();
        let study = plan.study();
        let capture = self.capture().filter(|_| !plan.own_rooms).cloned();
        let folder = PathBuf::from(plan.folder.trim());
        let (on, folder) = match &capture {
            Some(capture) => (capture.name.clone(), folder.join(file_name(&capture.name))),
            None => (OWN_ROOMS.to_owned(), folder),
        };
        self.studies.shown = Some(Shown {
            study,
            on,
            plot: None,
            seen: Vec::new(),
            folder: None,
        });
        let ctx = ctx.clone();
        let wake = move || ctx.request_repaint();
        let begun = Task::begin("study", wake, move |course| {
            run(course, &plan, capture.as_deref(), folder)
        });
        match begun {
            Ok(task) => self.studies.running = Some((task, Instant::now())),
            Err(error) => self.notices.say(Level::Error, error.to_string()),
        }
    }

    /// Takes in what a study shows; a solve that begins ends it, since each would slow the other.
    pub(in crate::app) fn take_study(&mut self) {
        let running = self.is_running();
        let Some((task, _)) = &mut self.studies.running else {
            return;
        };
        if running {
            task.cancel();
        }
        let plot = task.newest();
        let end = task.end().map(|end| (end, task.is_cancelled()));
        if let Some(shown) = &mut self.studies.shown {
            shown.plot = plot.or(shown.plot.take());
        }
        let Some((end, cancelled)) = end else {
            return;
        };
        self.studies.running = None;
        let Some(shown) = &mut self.studies.shown else {
            return;
        };
        let name = shown.study.name;
        match end {
            Ok(ended) => {
                let folder = ended.folder.display().to_string();
                shown.plot = ended.plot.or(shown.plot.take());
                shown.seen = ended.seen;
                shown.folder = Some(ended.folder);
                let message = format!("study {name} written to {folder}");
                self.notices.say(Level::Info, message);
            }
            Err(_) if cancelled => {
                let message = format!("study {name} was ended; nothing is written of it");
                self.notices.say(Level::Warning, message);
            }
            Err(message) => self.notices.say(Level::Error, message),
        }
    }
}

/// What studies run on without a capture.
pub const OWN_ROOMS: &str = "rooms of its own";

fn run(
    course: &Course<Plot>,
    plan: &Plan,
    capture: Option<&OpenCapture>,
    folder: PathBuf,
) -> Result<Ended> {
    course.say("making ready");
    let study = plan.study();
    let subject = capture.map(OpenCapture::subject).transpose()?;
    let findings = study.run(&Bench {
        quick: plan.quick,
        time: Duration::try_from_secs_f64(plan.seconds).unwrap_or(Duration::MAX),
        seeds: plan.seeds,
        subject: subject.as_ref(),
        say: &|what| course.say(what),
        show: &|plot| course.show(plot),
        stopped: &|| course.is_ended(),
    })?;
    course.say("writing");
    findings.write(study, &folder)?;
    Ok(Ended {
        plot: findings.plots.into_iter().next().map(|(_, plot)| plot),
        seen: findings.seen,
        folder,
    })
}
