//! Results written into their folder.

use crate::error::{Error, Result};
use crate::export::plot::loss_plot;
use crate::export::scene::{self, Format};
use crate::export::table::{Cell, Table};
use crate::inverse::solver::LossPoint;
use crate::session::save::estimate::EstimateFile;
use crate::session::save::pictures;
use crate::session::save::report::{Report, Seconds};
use crate::session::save::staging::Staging;
use crate::session::save::{CHECKPOINT, CheckpointFile, ESTIMATE, REPORT, Results};
use serde::Serialize;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

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
    staging.commit(earlier)
}

/// Writes the estimate and its pictures alone, as after an edit.
///
/// # Errors
/// The folder cannot be written.
pub fn write_estimate(folder: &Path, results: &Results) -> Result<()> {
    let mut staging = Staging::new(folder)?;
    stage_estimate(&mut staging, folder, results)?;
    staging.commit(earlier)
}

fn stage_estimate(staging: &mut Staging, folder: &Path, results: &Results) -> Result<()> {
    pictures::write(staging, results)?;
    let scene = staging.file("scene.glb")?;
    scene::write(
        &results.capture.scene,
        &results.edited(),
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
    let own = estimate.maps.clone().map(PathBuf::from);
    let checkpoint = CheckpointFile {
        estimate,
        checkpoint: results.checkpoint.clone(),
    };
    staging.write(CHECKPOINT, &json(CHECKPOINT, &checkpoint)?)?;
    // Maps of the checkpoint before, unless they are those of finished results.
    staging.commit(|folder| {
        let mut stale = earlier_maps(folder);
        stale.retain(|name| Some(name) != own.as_ref());
        if !stale.is_empty() {
            let finished = fs::read(folder.join(ESTIMATE)).unwrap_or_default();
            let finished: Option<EstimateFile> = serde_json::from_slice(&finished).ok();
            let kept = finished.and_then(|file| file.maps).map(PathBuf::from);
            stale.retain(|name| Some(name) != kept.as_ref());
        }
        stale
    })
}

impl Results {
    fn file(&self, folder: &Path) -> Result<(EstimateFile, Option<Vec<u8>>)> {
        EstimateFile::new(
            folder,
            &self.capture,
            &self.settings,
            &self.estimate,
            &self.edits,
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
    names.extend(earlier_maps(folder));
    names
}

/// All maps in a folder.
fn earlier_maps(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let is_maps = |n: &String| n.starts_with("maps-") && n.ends_with(".safetensors");
    names.filter(is_maps).map(PathBuf::from).collect()
}

fn json(name: &str, value: &impl Serialize) -> Result<Vec<u8>> {
    let mut bytes = serde_json::to_vec_pretty(value)
        .map_err(|error| Error::new(name, error, "report this as a fault of the program"))?;
    bytes.push(b'\n');
    Ok(bytes)
}
