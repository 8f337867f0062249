//! Writes results into their folder.

use crate::error::{Error, Result};
use crate::export::overwrite::{CHECKPOINT, ESTIMATE, REPORT};
use crate::export::plot::loss_plot;
use crate::export::scene::{self, Format};
use crate::export::table::Table;
use crate::inverse::solver::Progress;
use crate::session::save::estimate::{CheckpointFile, EstimateFile};
use crate::session::save::pictures;
use crate::session::save::report::Report;
use crate::session::save::results::Results;
use crate::session::save::staging::Staging;
use serde::Serialize;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// File name of the exported scene.
const SCENE: &str = "scene.glb";

/// Writes a folder of results: first the estimate with report and losses, then the scene and the pictures. Each step
/// is atomic, so a failure leaves the files of the step before.
///
/// # Errors
/// The folder cannot be written, or holds results of another capture. The error says whether the estimate was written.
pub fn write(folder: &Path, results: &Results) -> Result<()> {
    let started = Instant::now();
    let report = || {
        let seconds_write = started.elapsed().as_secs_f64();
        json(REPORT, &Report::new(results, seconds_write))
    };
    let mut staging = Staging::new(folder, &results.capture_id())?;
    stage_estimate(&mut staging, folder, results)?;
    staging.write(REPORT, &report()?)?;
    let table = losses(&results.progress).write(&staging.file("loss.csv")?);
    table.map_err(|error| staging.named(error))?;
    staging.commit(earlier)?;

    write_shown(folder, results, |staging| {
        let progress = &results.progress;
        let plot = loss_plot(progress);
        plot.write(&staging.file("loss.png")?)?;
        staging.write(REPORT, &report()?)
    })
}

/// Writes an edited estimate and its pictures.
pub(crate) fn write_edited(folder: &Path, results: &Results) -> Result<()> {
    let mut staging = Staging::new(folder, &results.capture_id())?;
    stage_estimate(&mut staging, folder, results)?;
    staging.commit(earlier)?;
    write_shown(folder, results, |_| Ok(()))
}

/// Stages the estimate with its maps and checkpoint.
fn stage_estimate(staging: &mut Staging, folder: &Path, results: &Results) -> Result<()> {
    let file = stage_checkpoint(staging, folder, results, results.checkpoint.is_some())?;
    staging.write(ESTIMATE, &json(ESTIMATE, &file)?)
}

/// Stages the maps and, if `wanted`, the checkpoint of an estimate. Returns the content of its `estimate.json`.
fn stage_checkpoint(
    staging: &mut Staging,
    folder: &Path,
    results: &Results,
    wanted: bool,
) -> Result<EstimateFile> {
    let (estimate, maps) = EstimateFile::new(folder, results)?;
    if let (Some(name), Some(bytes)) = (&estimate.maps, &maps) {
        staging.write(name, bytes)?;
    }
    let checkpoint = results.checkpoint.clone();
    let file = CheckpointFile {
        estimate,
        checkpoint,
    };
    if wanted {
        staging.write(CHECKPOINT, &json(CHECKPOINT, &file)?)?;
    }
    Ok(file.estimate)
}

/// Writes the scene and the pictures of an estimate that is already written, and what `extra` adds.
fn write_shown(
    folder: &Path,
    results: &Results,
    extra: impl FnOnce(&mut Staging) -> Result<()>,
) -> Result<()> {
    let mut staging = Staging::new(folder, &results.capture_id())?;
    let scene = |staging: &mut Staging| {
        let path = staging.file(SCENE)?;
        let (scene, estimate) = (&results.capture.scene, results.edited());
        scene::write(scene, &estimate, Format::Glb, &path)
    };
    scene(&mut staging)
        .and_then(|()| pictures::write(&mut staging, results))
        .and_then(|()| extra(&mut staging))
        .map_err(|error| staging.named(error))
        .and_then(|()| staging.commit(|_| Vec::new()))
        .map_err(|error| Error {
            problem: format!(
                "{}; the estimate is saved, its pictures and {SCENE} are not",
                error.problem
            ),
            ..error
        })
}

/// Writes only `checkpoint.json`, during a solve.
///
/// # Errors
/// The folder cannot be written.
pub fn write_checkpoint(folder: &Path, results: &Results) -> Result<()> {
    let mut staging = Staging::new(folder, &results.capture_id())?;
    let estimate = stage_checkpoint(&mut staging, folder, results, true)?;
    let own_maps = estimate.maps.map(PathBuf::from);
    // Remove the maps of the previous checkpoint, unless finished results use them.
    staging.commit(|folder| {
        let mut stale = earlier_maps(folder);
        stale.retain(|name| Some(name) != own_maps.as_ref());
        if !stale.is_empty() {
            let finished = fs::read(folder.join(ESTIMATE)).unwrap_or_default();
            let finished: Option<EstimateFile> = serde_json::from_slice(&finished).ok();
            let kept = finished.and_then(|file| file.maps).map(PathBuf::from);
            stale.retain(|name| Some(name) != kept.as_ref());
        }
        stale
    })
}

/// A row of loss.csv.
#[derive(Default, Serialize)]
struct LossRow {
    seconds: f64,
    iteration: u64,
    train: Option<f64>,
    held_out: Option<f64>,
    residual: Option<f64>,
    stderr: Option<f64>,
    unknowns: Option<u64>,
    texture_residual: Option<f64>,
}

/// The course of a solve as a table, in order of time: losses in the fit and on held-out pixels where they were measured, after
/// each iteration the relative residual of the fit, the relative error that the estimate reports, and the number of unknowns, and
/// the relative residuals of textures.
fn losses(progress: &Progress) -> Table {
    let mut table =
        Table::new("seconds,iteration,train,held_out,residual,stderr,unknowns,texture_residual");
    let losses = progress.losses.iter().map(|p| LossRow {
        seconds: p.seconds,
        iteration: p.iteration,
        train: p.train,
        held_out: p.held_out,
        ..LossRow::default()
    });
    let fits = progress.fits.iter().map(|p| LossRow {
        seconds: p.seconds,
        iteration: p.iteration,
        residual: Some(p.residual),
        stderr: p.stderr,
        unknowns: Some(p.unknowns),
        ..LossRow::default()
    });
    let textures = progress.textures.iter().map(|p| LossRow {
        seconds: p.seconds,
        iteration: p.iteration,
        texture_residual: Some(p.residual),
        ..LossRow::default()
    });
    let mut rows: Vec<LossRow> = losses.chain(fits).chain(textures).collect();
    rows.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
    rows.into_iter().for_each(|row| table.row(row));
    table
}

/// Files of an earlier run that a new one replaces, but may not write again under the same name.
fn earlier(folder: &Path) -> Vec<PathBuf> {
    let mut names = pictures::earlier(folder);
    names.extend([CHECKPOINT, SCENE, "loss.png"].map(PathBuf::from));
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
