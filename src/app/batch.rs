//! Photographs written in one go on a thread of their own, with progress and cancel.

use crate::app::state::App;
use crate::error::{Error, Result};
use crate::session::edits::Edits;
use crate::session::photographs::{Photographs, WriteProgress, Written};
use crate::session::snapshot::Level;
use crate::transport::denoise::Denoiser;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

/// A batch under way.
pub struct Batch {
    folder: PathBuf,
    wanted: usize,
    course: Arc<Course>,
    thread: Option<JoinHandle<Result<Written>>>,
}

/// What the thread tells and hears.
#[derive(Default)]
struct Course {
    cancelled: AtomicBool,
    doing: Mutex<Option<WriteProgress>>,
}

impl Batch {
    /// Begins to write `folder`/NNN.*; `wake` is called after every change.
    ///
    /// # Errors
    /// The folder cannot be made, or the system grants no thread.
    pub fn begin(
        work: Photographs,
        folder: PathBuf,
        wake: impl Fn() + Send + 'static,
    ) -> Result<Self> {
        std::fs::create_dir_all(&folder).map_err(|error| Error::io(&folder, &error))?;
        let course = Arc::new(Course::default());
        let (shared, into, wanted) = (course.clone(), folder.clone(), work.frames.len());
        let thread = std::thread::Builder::new()
            .name("photographs".to_owned())
            .spawn(move || {
                let end = work.write(&|frame| into.join(format!("{frame:03}")), &|doing| {
                    let told = shared.tell(doing);
                    if told {
                        wake();
                    }
                    !shared.cancelled.load(Ordering::Relaxed)
                });
                wake();
                end
            })
            .map_err(|error| {
                Error::new("photographs", error, "close other programs and try again")
            })?;
        Ok(Self {
            folder,
            wanted,
            course,
            thread: Some(thread),
        })
    }

    /// Asks it to end soon.
    pub fn cancel(&self) {
        self.course.cancelled.store(true, Ordering::Relaxed);
    }

    /// What it is at.
    pub fn doing(&self) -> Option<WriteProgress> {
        let doing = self.course.doing.lock();
        *doing.unwrap_or_else(PoisonError::into_inner)
    }

    /// The folder that it writes into.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// How it ended, once it has.
    fn ended(&mut self) -> Option<std::result::Result<Written, String>> {
        let thread = self.thread.take_if(|thread| thread.is_finished())?;
        Some(match thread.join() {
            Ok(end) => end.map_err(|error| error.to_string()),
            Err(_) => Err("photographs: internal error; try again".to_owned()),
        })
    }
}

impl Drop for Batch {
    fn drop(&mut self) {
        self.cancel();
    }
}

impl Course {
    /// Notes how far it is; whether that is worth a look (another photograph, or half a percent).
    fn tell(&self, doing: WriteProgress) -> bool {
        let last = &mut *self.doing.lock().unwrap_or_else(PoisonError::into_inner);
        let same =
            last.is_some_and(|l| l.frame == doing.frame && doing.fraction - l.fraction < 0.005);
        if !same {
            *last = Some(doing);
        }
        !same
    }
}

impl App {
    /// Whether there is anything to make of photographs: an object to put in, or light to change.
    pub fn can_write_photographs(&self) -> bool {
        let changed = !self.edits.is_empty() || !self.insertions.visible().is_empty();
        self.capture().is_some() && self.batch.is_none() && changed
    }

    /// Begins to write photographs: one, or all where `frame` is `None`; in the light of the changes that are given.
    pub fn write_photographs(
        &mut self,
        ctx: &egui::Context,
        folder: PathBuf,
        frame: Option<usize>,
        edits: &Edits,
        (samples, denoise): (u32, bool),
    ) {
        let Some(capture) = self.capture().filter(|_| self.can_write_photographs()) else {
            return;
        };
        let work = Photographs {
            frames: frame.map_or_else(|| (0..self.frames()).collect(), |frame| vec![frame]),
            capture: capture.clone(),
            found: self.snapshot.estimate.clone(),
            edited: Arc::new(edits.apply(&self.snapshot.estimate)),
            settings: self.snapshot.settings.clone(),
            placements: self.insertions.visible(),
            relight: !edits.is_empty(),
            samples,
            denoise: denoise.then(Denoiser::best),
            finish: self.insertions.finish,
        };
        let ctx = ctx.clone();
        match Batch::begin(work, folder, move || ctx.request_repaint()) {
            Ok(batch) => self.batch = Some(batch),
            Err(error) => self.notices.say(Level::Error, error.to_string()),
        }
    }

    /// Says how a batch ended.
    pub(in crate::app) fn take_batch(&mut self) {
        let Some(batch) = &mut self.batch else {
            return;
        };
        let Some(end) = batch.ended() else {
            return;
        };
        let (folder, wanted) = (batch.folder.display().to_string(), batch.wanted);
        self.batch = None;
        match end {
            Ok(written) => {
                for warning in written.warnings {
                    self.notices.say(Level::Warning, warning);
                }
                let done = written.photographs;
                let (level, message) = if done == wanted {
                    let s = if done == 1 { "" } else { "s" };
                    (
                        Level::Info,
                        format!("{done} photograph{s} written to {folder}"),
                    )
                } else {
                    let message =
                        format!("ended after {done} of {wanted} photographs, written to {folder}");
                    (Level::Warning, message)
                };
                self.notices.say(level, message);
            }
            Err(message) => self.notices.say(Level::Error, message),
        }
    }
}
