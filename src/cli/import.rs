//! `relit import`: scans of other programs as captures.

use crate::capture::import::{self, AppliedTransform, Format, Import, ImportOptions};
use crate::capture::read::CAMERAS;
use crate::cli::numbers::{above_zero, from_one, intrinsics, triple};
use crate::cli::options::Replace;
use crate::cli::progress::bar;
use crate::error::Result;
use crate::export;
use crate::say;
use crate::session::command::PathKind;
use clap::builder::PossibleValuesParser;
use clap::{Args, ValueEnum};
use glam::DVec3;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub struct ImportArguments {
    /// Folder of the scan
    source: PathBuf,
    /// Folder to write the capture into: new, or empty
    #[arg(long, value_name = "CAPTURE")]
    out: PathBuf,
    #[command(flatten)]
    replace: Replace,
    /// Layout of the folder [default: found by its content]
    #[arg(long, value_name = "F", value_parser = PossibleValuesParser::new(Format::ALL.iter().map(|(word, _)| *word)))]
    format: Option<String>,
    /// Mesh in the poses' coordinates: OBJ, PLY, GLB [default: the scan's own, or one fused from depth]
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    /// Edge of the voxels of a fused mesh [default: 1/256 of the depth's extent]
    #[arg(long, value_name = "METRES", value_parser = above_zero)]
    voxel: Option<f64>,
    /// Take every N-th frame as a photograph; depth is fused from all
    #[arg(long, value_name = "N", value_parser = from_one::<u32>)]
    every: Option<u32>,
    /// Take at most N photographs, evenly spaced [default: 200 of a video, else all]
    #[arg(long, value_name = "N", value_parser = from_one::<u32>)]
    max_frames: Option<u32>,
    /// Keep the scan's poses, instead of refining them on photographs and depth images
    #[arg(long)]
    keep_poses: bool,
    /// Up axis of the capture [default: the cameras' mean up]
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    up: Option<DVec3>,
    /// Intrinsics of the colour camera, in pixels with centres at whole numbers, for a scan that has none; half the size is the middle
    #[arg(long, value_name = "FX,FY,CX,CY", value_parser = intrinsics, allow_hyphen_values = true)]
    intrinsics: Option<[f64; 4]>,
    /// Nerfstudio's applied_transform [default: undone for a mesh that comes from elsewhere]
    #[arg(long, value_enum, value_name = "undo|keep")]
    applied_transform: Option<Applied>,
}

/// What to do with an applied_transform.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Applied {
    /// The mesh has the coordinates from before it
    Undo,
    /// Mesh and poses share its coordinates
    Keep,
}

/// Imports a scan as a capture and prints what was found and guessed.
pub fn import(arguments: &ImportArguments) -> Result<()> {
    arguments.replace.apply();
    let named = |word: &String| Format::ALL.iter().find(|(name, _)| name == word);
    let options = ImportOptions {
        format: arguments.format.as_ref().and_then(named).map(|f| f.1),
        mesh: arguments.mesh.clone(),
        voxel: arguments.voxel,
        every: arguments.every.unwrap_or(0) as usize,
        max_frames: arguments.max_frames.map(|n| n as usize),
        keep_poses: arguments.keep_poses,
        up: arguments.up,
        intrinsics: arguments.intrinsics,
        applied_transform: match arguments.applied_transform {
            None => AppliedTransform::Guess,
            Some(Applied::Undo) => AppliedTransform::Undo,
            Some(Applied::Keep) => AppliedTransform::Keep,
        },
    };
    let scan = read(&arguments.source, &options)?;
    for line in &scan.remarks {
        say::line(line);
    }
    export::import::write(&arguments.out, &scan)?;
    say::line(arguments.out.display());
    Ok(())
}

/// Imports a scan that was given where a capture is expected, into the folder of its results, unless it was imported before.
/// Returns the folder of the capture.
pub fn beside_results(scan: &Path) -> Result<PathBuf> {
    let out = PathKind::imported(scan);
    let said = format!("{}: imported into {}", scan.display(), out.display());
    if out.join(CAMERAS).exists() {
        say::note(format_args!("{said} before"));
        return Ok(out);
    }
    let read = read(scan, &ImportOptions::default())?;
    for line in &read.remarks {
        say::note(line);
    }
    export::import::write(&out, &read)?;
    say::note(said);
    Ok(out)
}

/// Reads a scan, with a progress bar where depth images are fused.
fn read(source: &Path, options: &ImportOptions) -> Result<Import> {
    let bar = bar("{bar:24} {pos} of {len} depth images fused");
    let scan = import::read(source, options, &mut |done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    });
    bar.finish_and_clear();
    scan
}
