//! What a solve leaves in its folder, and how it is taken up again.

pub mod estimate;
pub mod maps;
mod memory;
pub mod named;
pub mod pictures;
pub mod report;
mod saved;
pub mod staging;
mod write;

pub use crate::export::overwrite::{CHECKPOINT, ESTIMATE, REPORT};
pub use saved::{Saved, load, load_checkpoint};
pub use write::{write, write_checkpoint, write_edited};

use crate::export::overwrite::CaptureId;
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Checkpoint, Progress, Termination};
use crate::render::Renderer;
use crate::session::command::Source;
use crate::session::edits::{Edited, Edits};
use crate::session::snapshot::OpenCapture;
use crate::transport::denoise::Denoiser;
use estimate::EstimateFile;
use pictures::Frames;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Instant;

/// Everything that is written at the end of a solve.
#[derive(Debug, Clone)]
pub struct Results {
    /// What was solved.
    pub capture: Arc<OpenCapture>,
    /// With which parameters.
    pub settings: Settings,
    /// What was found.
    pub estimate: Arc<Estimate>,
    /// What was changed of it by hand; pictures and the scene show it.
    pub edits: Edits,
    /// How it went.
    pub progress: Arc<Progress>,
    /// Why it ended; `None` while it runs.
    pub stopped_because: Option<Termination>,
    /// Where to go on from.
    pub checkpoint: Option<Checkpoint>,
    /// Which frames get pictures.
    pub views: Frames,
    /// What traces their paths.
    pub renderer: Renderer,
    /// What takes the noise out of their PNGs, if anything does.
    pub denoiser: Option<Denoiser>,
    /// When the work began.
    pub started: Instant,
    /// Seconds spent reading the capture.
    pub seconds_load: f64,
}

impl Results {
    /// The capture that they are of, for whoever asks what they may replace.
    pub fn capture_id(&self) -> CaptureId {
        CaptureId::from(self.capture.as_ref())
    }

    /// What was found, with the changes made by hand.
    pub fn edited(&self) -> Arc<Estimate> {
        Edited::default().of(&self.estimate, &self.edits)
    }
}

impl From<&OpenCapture> for CaptureId {
    fn from(capture: &OpenCapture) -> Self {
        Self {
            hash: capture.hash.clone(),
            folder: match &capture.source {
                Source::BuiltInRoom => None,
                Source::Folder(folder) => Some(folder.clone()),
            },
        }
    }
}

/// `checkpoint.json`: an estimate on its way.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct CheckpointFile {
    estimate: EstimateFile,
    checkpoint: Option<Checkpoint>,
}
