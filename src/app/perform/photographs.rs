//! Writing photographs in one go.

use crate::app::shell::sheet::Wanted;
use crate::app::shell::status::Batch;
use crate::app::state::App;
use crate::app::task::{Progress, Task};
use crate::error::{Error, Result};
use crate::session::photographs::{Photographs, WriteProgress, Written};
use crate::session::snapshot::Level;
use crate::transport::denoise::Denoiser;
use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::sync::Arc;

impl App {
    /// Whether photographs can be written: something is inserted or edited, and none are being written.
    pub(super) fn can_write_photographs(&self) -> bool {
        let document = &self.document;
        let changed = !document.edits.is_empty() || !document.insertions.visible().is_empty();
        document.capture().is_some() && self.jobs.batch.is_none() && changed
    }

    pub(super) fn write_photographs(&mut self, wanted: &Wanted, ctx: &egui::Context) {
        let document = &self.document;
        let Some(capture) = document.capture().filter(|_| self.can_write_photographs()) else {
            return;
        };
        let (found, edits) = (&document.snapshot.estimate, &document.edits);
        let frames = match wanted.all {
            true => (0..document.frames()).collect(),
            false => vec![self.view.shown.frame],
        };
        let work = Photographs {
            frames,
            capture: capture.clone(),
            found: found.clone(),
            edited: Arc::new(edits.apply(found)),
            settings: document.snapshot.settings.clone(),
            placements: document.insertions.visible(),
            relight: !edits.is_empty(),
            samples: wanted.samples,
            denoise: wanted.denoise.then(Denoiser::best),
            finish: document.insertions.finish,
            renderer: self.jobs.renderer.clone(),
        };
        let folder = PathBuf::from(wanted.folder.trim());
        let (into, wanted) = (folder.clone(), work.frames.len());
        let begun = std::fs::create_dir_all(&folder).map_err(|error| Error::io(&folder, &error));
        let write = move |progress: &Progress<_>| write(progress, &work, &into);
        match begun.and_then(|()| Task::begin("photographs", ctx, write)) {
            Ok(task) => {
                self.jobs.batch = Some(Batch {
                    folder,
                    doing: None,
                    wanted,
                    task,
                });
            }
            Err(error) => self.say(Level::Error, error.to_string()),
        }
    }

    /// Follows a batch, and says how it ended.
    pub(in crate::app) fn take_batch(&mut self) {
        let Some(batch) = &mut self.jobs.batch else {
            return;
        };
        batch.doing = batch.task.newest().or(batch.doing);
        let Some(end) = batch.task.end() else {
            return;
        };
        let (folder, wanted) = (batch.folder.display().to_string(), batch.wanted);
        self.jobs.batch = None;
        let written = match end {
            Ok(written) => written,
            Err(message) => return self.say(Level::Error, message),
        };
        for warning in written.warnings {
            self.say(Level::Warning, warning);
        }
        let done = written.photographs;
        let s = if done == 1 { "" } else { "s" };
        if done == wanted {
            let message = format!("{done} photograph{s} written to {folder}");
            return self.say(Level::Info, message);
        }
        let message = format!("ended after {done} of {wanted} photographs, written to {folder}");
        self.say(Level::Warning, message);
    }
}

/// Writes `folder`/NNN.*.
fn write(progress: &Progress<WriteProgress>, work: &Photographs, folder: &Path) -> Result<Written> {
    let shown = Cell::new(None);
    let tell = |doing: WriteProgress| {
        // Another photograph, or half a percent.
        let is_news = |last: WriteProgress| {
            last.frame != doing.frame || doing.fraction - last.fraction >= 0.005
        };
        if shown.get().is_none_or(is_news) {
            shown.set(Some(doing));
            progress.show(doing);
        }
        !progress.is_cancelled()
    };
    work.write(&|frame| folder.join(format!("{frame:03}")), &tell)
}
