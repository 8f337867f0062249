//! Loads results from their folder.

use crate::error::{Error, Result};
use crate::export::overwrite::{CHECKPOINT, ESTIMATE};
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Checkpoint, Termination};
use crate::session::command::{OpenOptions, Source};
use crate::session::edits::Edits;
use crate::session::open_capture::OpenCapture;
use crate::session::save::estimate::{CheckpointFile, EstimateFile, read_whole};
use crate::session::save::maps::Maps;
use std::path::{Path, PathBuf};

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
    ///
    /// # Errors
    /// The capture has no object of a name.
    pub fn edits_for(&self, capture: &OpenCapture) -> Result<Edits> {
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
