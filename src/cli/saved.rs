//! Options and loading of earlier results, shared by several commands.

use crate::cli::numbers::threads;
use crate::error::Result;
use crate::inverse::estimate::Estimate;
use crate::session::command::{OpenOptions, Source};
use crate::session::edits::Edits;
use crate::session::open::open;
use crate::session::save::{self, Saved};
use crate::session::snapshot::OpenCapture;
use clap::Args;
use std::path::PathBuf;
use std::sync::Arc;

/// Which results to load.
#[derive(Debug, Args)]
pub struct SavedOptions {
    /// Folder that relit solve wrote
    pub dir: PathBuf,
    /// Where the capture is now, if it was moved
    #[arg(long, value_name = "DIR")]
    pub capture: Option<PathBuf>,
    /// Number of threads [default: one per core]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub threads: Option<u16>,
    /// Let paths in the capture lead out of its folder; only for captures that you trust
    #[arg(long)]
    pub allow_outside: bool,
}

/// Results with their capture.
pub struct Loaded {
    /// What the results folder holds.
    pub saved: Saved,
    /// The capture, opened again.
    pub capture: Arc<OpenCapture>,
    /// The estimate as it was solved.
    pub found: Arc<Estimate>,
    /// Edits by hand.
    pub edits: Edits,
    /// The estimate with the edits.
    pub estimate: Arc<Estimate>,
}

impl SavedOptions {
    /// Loads the results and opens their capture.
    ///
    /// # Errors
    /// The results or the capture are missing or broken, or they do not belong together.
    pub fn load(&self) -> Result<Loaded> {
        crate::cli::solve::use_threads(self.threads)?;
        let saved = save::load(&self.dir)?;
        let moved = self.capture.clone().map(Source::Folder);
        let options = OpenOptions {
            allow_outside: self.allow_outside,
            ..saved.options.clone()
        };
        let capture = open(moved.as_ref().unwrap_or(&saved.source), &options)?;
        let found = saved.estimate_for(&capture)?;
        let edits = saved.edits_for(&capture)?;
        Ok(Loaded {
            saved,
            capture: Arc::new(capture),
            estimate: Arc::new(edits.apply(&found)),
            found: Arc::new(found),
            edits,
        })
    }
}
