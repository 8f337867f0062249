//! Photographs written in one go on a thread of their own, with progress and cancel.

use crate::app::task::Task;
use crate::error::{Error, Result};
use crate::session::photographs::{Photographs, WriteProgress, Written};
use std::cell::Cell;
use std::path::PathBuf;

/// A batch under way.
pub struct Batch {
    /// The folder that it writes into.
    pub folder: PathBuf,
    /// What it is at.
    pub doing: Option<WriteProgress>,
    /// How many photographs it is to write.
    pub wanted: usize,
    /// The work.
    pub task: Task<WriteProgress, Written>,
}

impl Batch {
    /// Begins to write `folder`/NNN.*; `wake` is called after every change.
    ///
    /// # Errors
    /// The folder cannot be made, or the system grants no thread.
    pub fn begin(
        work: Photographs,
        folder: PathBuf,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> Result<Self> {
        std::fs::create_dir_all(&folder).map_err(|error| Error::io(&folder, &error))?;
        let (into, wanted) = (folder.clone(), work.frames.len());
        let task = Task::begin("photographs", wake, move |progress| {
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
            work.write(&|frame| into.join(format!("{frame:03}")), &tell)
        })?;
        Ok(Self {
            folder,
            doing: None,
            wanted,
            task,
        })
    }
}
