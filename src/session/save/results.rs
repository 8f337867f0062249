//! Everything that is written at the end of a solve.

use crate::export::overwrite::CaptureId;
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Checkpoint, Progress, Termination};
use crate::render::Renderer;
use crate::session::command::Source;
use crate::session::edits::{Edited, Edits};
use crate::session::open_capture::OpenCapture;
use crate::transport::denoise::Denoiser;
use std::sync::Arc;
use std::time::Instant;

/// Long side of the pictures in pixels if their number is limited.
const LONG_SIDE: u32 = 1024;

/// Which frames get pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frames {
    /// Every frame, at the photograph's size.
    All,
    /// At most this many, evenly spaced, of limited size.
    AtMost(usize),
}

impl Default for Frames {
    fn default() -> Self {
        Self::AtMost(16)
    }
}

impl Frames {
    /// The indices of the chosen frames among `count`.
    pub fn chosen(self, count: usize) -> Vec<usize> {
        match self {
            Self::AtMost(max) if max < count => (0..max).map(|i| i * count / max).collect(),
            _ => (0..count).collect(),
        }
    }

    /// Long side of the pictures in pixels, at most.
    pub fn long_side(self) -> u32 {
        match self {
            Self::All => u32::MAX,
            Self::AtMost(_) => LONG_SIDE,
        }
    }
}

/// Everything that is written at the end of a solve.
#[derive(Debug, Clone)]
pub struct Results {
    /// The open capture.
    pub capture: Arc<OpenCapture>,
    /// The parameters of the solve.
    pub settings: Settings,
    /// The estimate.
    pub estimate: Arc<Estimate>,
    /// Edits of the estimate; pictures and the exported scene show them.
    pub edits: Edits,
    /// Progress of the solve.
    pub progress: Arc<Progress>,
    /// Why the solve ended; `None` during a solve.
    pub stopped_because: Option<Termination>,
    /// The checkpoint to resume from.
    pub checkpoint: Option<Checkpoint>,
    /// Which frames get pictures.
    pub views: Frames,
    /// Renders the pictures.
    pub renderer: Renderer,
    /// Denoises their PNGs, if set.
    pub denoiser: Option<Denoiser>,
    /// When the work began.
    pub started: Instant,
    /// Seconds spent reading the capture.
    pub seconds_load: f64,
}

impl Results {
    /// Identifies their capture, for checking what they may replace.
    pub fn capture_id(&self) -> CaptureId {
        CaptureId::from(self.capture.as_ref())
    }

    /// The estimate with the edits.
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
