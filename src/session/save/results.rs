//! Everything that is written at the end of a solve, and what is loaded of it again.

use crate::error::{Error, Result};
use crate::export::overwrite::{CHECKPOINT, CaptureId, ESTIMATE};
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Checkpoint, Progress, Termination};
use crate::render::Renderer;
use crate::session::command::{OpenOptions, Source};
use crate::session::edits::{Edited, Edits};
use crate::session::open_capture::OpenCapture;
use crate::session::save::estimate::{CheckpointFile, EstimateFile, read_whole};
use crate::session::save::maps::Maps;
use crate::transport::denoise::Denoiser;
use std::path::{Path, PathBuf};
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

/// Loaded results.
#[derive(Debug, Clone)]
pub struct Saved {
    path: PathBuf,
    file: EstimateFile,
    maps: Maps,
    /// The capture they belong to.
    pub source: Source,
    /// Options for reading the capture.
    pub options: OpenOptions,
    /// The parameters.
    pub settings: Settings,
    /// The checkpoint to resume from; `None` if the solve converged.
    pub checkpoint: Option<Checkpoint>,
    /// Why the solve ended.
    pub termination: Termination,
}

/// Loads the results in a folder, or the checkpoint if the solve has not ended.
///
/// # Errors
/// There are no results, or they are broken.
pub fn load(folder: &Path) -> Result<Saved> {
    let path = folder.join(ESTIMATE);
    let at = folder.join(CHECKPOINT);
    let checkpoint: Option<CheckpointFile> = at.exists().then(|| read_json(&at)).transpose()?;
    let (path, file) = match (path.exists(), &checkpoint) {
        (false, Some(checkpoint)) => (at, checkpoint.estimate.clone()),
        _ => {
            let file = read_json(&path)?;
            (path, file)
        }
    };
    Saved::new(folder, path, file, checkpoint.and_then(|c| c.checkpoint))
}

/// Loads the newest checkpoint in a folder, or the results without one.
///
/// # Errors
/// There are no results, or they are broken.
pub fn load_checkpoint(folder: &Path) -> Result<Saved> {
    let at = folder.join(CHECKPOINT);
    if !at.exists() {
        return load(folder);
    }
    let file: CheckpointFile = read_json(&at)?;
    Saved::new(folder, at, file.estimate, file.checkpoint)
}

impl Saved {
    fn new(
        folder: &Path,
        path: PathBuf,
        file: EstimateFile,
        checkpoint: Option<Checkpoint>,
    ) -> Result<Self> {
        file.check(&path)?;
        Ok(Self {
            maps: file.read_maps(folder)?,
            source: file.capture.source(folder),
            options: file.capture.options.clone(),
            settings: file.settings.clone(),
            checkpoint,
            termination: file.stopped_because.unwrap_or(Termination::Cancelled),
            path,
            file,
        })
    }

    /// The content of `estimate.json`.
    pub fn file(&self) -> &EstimateFile {
        &self.file
    }

    /// The estimate for the capture that it was made from.
    ///
    /// # Errors
    /// The capture is another one, or has changed.
    pub fn estimate_for(&self, capture: &OpenCapture) -> Result<Estimate> {
        if self.file.capture.hash != capture.hash {
            let problem = format!(
                "the mesh, the cameras or the photographs of {} are not those it was made from",
                capture.name
            );
            let place = format!("{}: capture.hash", self.path.display());
            let remedy = "name that capture, or solve again";
            return Err(Error::new(place, problem, remedy));
        }
        self.estimate_by_name(capture)
    }

    /// The edits of the estimate.
    pub(crate) fn edits_for(&self, capture: &OpenCapture) -> Result<Edits> {
        match &self.file.edits {
            Some(edits) => edits.edits(&self.path, &capture.scene),
            None => Ok(Edits::default()),
        }
    }

    /// The estimate for any capture with the same objects and mesh, whatever its photographs.
    ///
    /// # Errors
    /// An object is missing, or the maps belong to another mesh.
    pub fn estimate_by_name(&self, capture: &OpenCapture) -> Result<Estimate> {
        self.file.estimate(&self.path, &self.maps, capture)
    }
}

fn read_json<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T> {
    if !path.exists() {
        let problem = "there are no results here";
        let remedy = "name a folder that relit solve wrote";
        return Err(Error::file(path, problem, remedy));
    }
    let bytes = read_whole(path)?;
    serde_json::from_slice(&bytes)
        .map_err(|error| Error::file(path, error, "restore the file, or solve again"))
}
