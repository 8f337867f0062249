//! What a solve leaves in its folder, and how it is taken up again.

pub mod estimate;
pub mod maps;
mod memory;
pub mod named;
pub mod objects;
pub mod pictures;
pub mod report;
pub mod staging;

use crate::error::{Error, Result};
use crate::export::plot::loss_plot;
use crate::export::scene::{self, Format};
use crate::export::table::{Cell, Table};
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Checkpoint, LossPoint, Progress, Termination};
use crate::session::command::{OpenOptions, Source};
use crate::session::snapshot::OpenCapture;
use estimate::EstimateFile;
use maps::Maps;
use pictures::Frames;
use report::{Report, Seconds};
use serde::{Deserialize, Serialize};
use staging::Staging;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// The estimate, for later commands.
pub const ESTIMATE: &str = "estimate.json";
/// What the solve did.
pub const REPORT: &str = "report.json";
/// Where a solve can be taken up again.
pub const CHECKPOINT: &str = "checkpoint.json";

/// Everything that is written at the end of a solve.
#[derive(Debug, Clone)]
pub struct Results {
    /// What was solved.
    pub capture: Arc<OpenCapture>,
    /// With which parameters.
    pub settings: Settings,
    /// What was found.
    pub estimate: Arc<Estimate>,
    /// How it went.
    pub progress: Arc<Progress>,
    /// Why it ended; `None` while it runs.
    pub stopped_because: Option<Termination>,
    /// Where to go on from.
    pub checkpoint: Option<Checkpoint>,
    /// Which frames get pictures.
    pub views: Frames,
    /// When the work began.
    pub started: Instant,
    /// Seconds spent reading the capture.
    pub seconds_load: f64,
}

/// `checkpoint.json`: an estimate on its way.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct CheckpointFile {
    estimate: EstimateFile,
    checkpoint: Option<Checkpoint>,
}

/// Writes a folder of results. Everything is written aside and moved into place at the end, so that a failure
/// leaves an earlier run's files untouched.
///
/// # Errors
/// The folder cannot be written.
pub fn write(folder: &Path, results: &Results) -> Result<()> {
    let started = Instant::now();
    let mut staging = Staging::new(folder)?;
    stage_estimate(&mut staging, folder, results)?;
    losses(&results.progress.losses).write(&staging.file("loss.csv")?)?;
    loss_plot(&results.progress.losses, &results.progress.stages)
        .write(&staging.file("loss.png")?)?;
    let report = Report::new(
        &results.capture,
        &results.settings,
        &results.estimate,
        &results.progress,
        results.stopped_because,
        Seconds {
            total: results.started.elapsed().as_secs_f64(),
            load: results.seconds_load,
            write: started.elapsed().as_secs_f64(),
        },
    );
    staging.write(REPORT, &json(REPORT, &report)?)?;
    staging.commit(&earlier(folder))
}

/// Writes the estimate and its pictures alone, as after an edit.
///
/// # Errors
/// The folder cannot be written.
pub fn write_estimate(folder: &Path, results: &Results) -> Result<()> {
    let mut staging = Staging::new(folder)?;
    stage_estimate(&mut staging, folder, results)?;
    staging.commit(&earlier(folder))
}

fn stage_estimate(staging: &mut Staging, folder: &Path, results: &Results) -> Result<()> {
    pictures::write(staging, results)?;
    let scene = staging.file("scene.glb")?;
    scene::write(
        &results.capture.scene,
        &results.estimate,
        Format::Glb,
        &scene,
    )?;
    let (file, maps) = results.file(folder)?;
    if let (Some(name), Some(bytes)) = (&file.maps, &maps) {
        staging.write(name, bytes)?;
    }
    if results.checkpoint.is_some() {
        let checkpoint = CheckpointFile {
            estimate: file.clone(),
            checkpoint: results.checkpoint.clone(),
        };
        staging.write(CHECKPOINT, &json(CHECKPOINT, &checkpoint)?)?;
    }
    staging.write(ESTIMATE, &json(ESTIMATE, &file)?)
}

/// Writes `checkpoint.json` alone, while the solve runs.
///
/// # Errors
/// The folder cannot be written.
pub fn write_checkpoint(folder: &Path, results: &Results) -> Result<()> {
    let mut staging = Staging::new(folder)?;
    let (estimate, maps) = results.file(folder)?;
    if let (Some(name), Some(bytes)) = (&estimate.maps, &maps) {
        staging.write(name, bytes)?;
    }
    let checkpoint = CheckpointFile {
        estimate,
        checkpoint: results.checkpoint.clone(),
    };
    staging.write(CHECKPOINT, &json(CHECKPOINT, &checkpoint)?)?;
    staging.commit(&[])
}

impl Results {
    fn file(&self, folder: &Path) -> Result<(EstimateFile, Option<Vec<u8>>)> {
        EstimateFile::new(
            folder,
            &self.capture,
            &self.settings,
            &self.estimate,
            self.stopped_because,
        )
    }
}

/// The loss curve as a table: seconds, iterations, loss in the fit and on held-out pixels.
fn losses(points: &[LossPoint]) -> Table {
    let mut table = Table::new(&["seconds", "iteration", "train", "held_out"]);
    let cell = |value: Option<f64>| value.map_or(Cell::Empty, Cell::from);
    for point in points {
        table.row(&[
            Cell::from(point.seconds),
            Cell::from(point.iteration),
            cell(point.train),
            cell(point.held_out),
        ]);
    }
    table
}

/// Files of an earlier run that a new one replaces: those that it may not write again under the same name.
fn earlier(folder: &Path) -> Vec<PathBuf> {
    let mut names = pictures::earlier(folder);
    names.push(PathBuf::from(CHECKPOINT));
    let list = |path: &Path| {
        let entries = fs::read_dir(path).into_iter().flatten().flatten();
        entries.filter_map(|entry| entry.file_name().into_string().ok())
    };
    let is_maps = |n: &String| n.starts_with("maps-") && n.ends_with(".safetensors");
    names.extend(list(folder).filter(is_maps).map(PathBuf::from));
    names
}

fn json(name: &str, value: &impl Serialize) -> Result<Vec<u8>> {
    let mut bytes = serde_json::to_vec_pretty(value)
        .map_err(|error| Error::new(name, error, "report this as a fault of the program"))?;
    bytes.push(b'\n');
    Ok(bytes)
}

/// A folder of results, read back.
#[derive(Debug, Clone)]
pub struct Saved {
    path: PathBuf,
    file: EstimateFile,
    maps: Maps,
    /// Which capture it belongs to.
    pub source: Source,
    /// How the capture was read.
    pub options: OpenOptions,
    /// The parameters.
    pub settings: Settings,
    /// Where to go on from; `None` where the solve converged.
    pub checkpoint: Option<Checkpoint>,
    /// Why the solve ended.
    pub termination: Termination,
}

/// Reads the results in a folder, or where a solve did not come to its end, the checkpoint that it left.
///
/// # Errors
/// There are none, or they are broken.
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

/// Reads the newest checkpoint in a folder; the results where there is none.
///
/// # Errors
/// There is neither, or it is broken.
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

    /// The contents of `estimate.json`.
    pub fn file(&self) -> &EstimateFile {
        &self.file
    }

    /// The estimate for the capture that it was made from.
    ///
    /// # Errors
    /// The capture is another one, or has changed.
    pub fn estimate_for(&self, capture: &OpenCapture) -> Result<Estimate> {
        if self.file.capture.hash != capture.hash {
            return Err(Error::new(
                format!("{}: capture.hash", self.path.display()),
                format!(
                    "the mesh, the cameras or the photographs of {} are not those it was made from",
                    capture.name
                ),
                "name that capture with --capture, or solve again",
            ));
        }
        self.estimate_by_name(capture)
    }

    /// The estimate for a capture with the same objects and mesh, wherever its photographs come from.
    ///
    /// # Errors
    /// An object is missing, or the maps belong to another mesh.
    pub fn estimate_by_name(&self, capture: &OpenCapture) -> Result<Estimate> {
        self.file.estimate(&self.path, &self.maps, capture)
    }
}

fn read_json<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T> {
    let bytes = fs::read(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => Error::file(
            path,
            "there are no results here",
            "name a folder that relit solve wrote",
        ),
        _ => Error::io(path, &error),
    })?;
    serde_json::from_slice(&bytes)
        .map_err(|error| Error::file(path, error, "restore the file, or solve again"))
}
