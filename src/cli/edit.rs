//! `relit edit`: changes the emission and materials of objects in an estimate.

use crate::cli::numbers::from_one;
use crate::cli::object_values::ObjectValues;
use crate::cli::options::{DenoiseOptions, DeviceOptions, Replace, SavedOptions};
use crate::cli::progress::write_with_progress;
use crate::error::{Error, Result};
use crate::export::overwrite;
use crate::say;
use crate::session::edits::Edits;
use crate::session::photographs::Photographs;
use crate::session::save::pictures::Frames;
use crate::session::save::{self, Results};
use clap::Args;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

#[derive(Debug, Args)]
pub struct EditArguments {
    #[command(flatten)]
    saved: SavedOptions,
    #[command(flatten)]
    values: ObjectValues,
    /// Pictures to write: all frames at full size, N frames, or none [default: 16, long side 1024]
    #[arg(long, value_name = "all|N|none", value_parser = crate::cli::options::frames)]
    views: Option<Frames>,
    /// Also write every photograph relit, as photographs/NNN.relit.{exr,png}
    #[arg(long)]
    photographs: bool,
    /// Samples per pixel of relit photographs
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = from_one::<u32>)]
    spp: u32,
    #[command(flatten)]
    denoise: DenoiseOptions,
    #[command(flatten)]
    device: DeviceOptions,
    /// Folder to write into
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    replace: Replace,
}

/// Edits objects of an estimate and writes it with new renders. Returns the exit code.
pub fn edit(arguments: &EditArguments) -> Result<i32> {
    arguments.replace.apply();
    // Writing into the folder of the results would replace the estimate that was found.
    let absolute = |path: &PathBuf| path.canonicalize().ok();
    if absolute(&arguments.out).is_some_and(|out| absolute(&arguments.saved.dir) == Some(out)) {
        let problem = "is the folder of the results themselves";
        return Err(Error::usage("--out", problem, "choose another folder"));
    }
    // Nor may the results of another solve be replaced.
    overwrite::check(&arguments.out.join(save::REPORT))?;
    let renderer = arguments.device.renderer()?;
    let mut loaded = arguments.saved.load()?;
    let capture = loaded.capture;
    (arguments.values).add(&capture.scene, &mut loaded.edits, false)?;
    let edited = Arc::new(loaded.edits.apply(&loaded.found));
    let denoiser = arguments.denoise.denoiser(true)?;
    let photographs = arguments.photographs.then(|| Photographs {
        frames: (0..capture.scene.cameras.len()).collect(),
        capture: capture.clone(),
        found: loaded.found,
        edited: edited.clone(),
        settings: loaded.saved.settings.clone(),
        placements: Vec::new(),
        relight: true,
        samples: arguments.spp,
        denoise: denoiser,
        finish: true,
        renderer: renderer.clone(),
    });
    let results = Results {
        capture,
        settings: loaded.saved.settings,
        estimate: edited,
        edits: Edits::default(),
        progress: Arc::default(),
        stopped_because: Some(loaded.saved.termination),
        checkpoint: None,
        views: arguments.views.unwrap_or_default(),
        renderer,
        denoiser,
        started: Instant::now(),
        seconds_load: 0.0,
    };
    save::write_edited(&arguments.out, &results)?;
    let mut code = 0;
    if let Some(photographs) = &photographs {
        let folder = arguments.out.join("photographs");
        std::fs::create_dir_all(&folder).map_err(|error| Error::io(&folder, &error))?;
        code = write_with_progress(photographs, &|frame| folder.join(format!("{frame:03}")))?;
    }
    say::line(format_args!("results in {}", arguments.out.display()));
    Ok(code)
}
