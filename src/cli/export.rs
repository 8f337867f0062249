//! `relit export` and `relit demo`: files for other programs, and built-in and generated rooms as captures.

use crate::cli::numbers::{from_one, triple, whole, width};
use crate::cli::options::{Replace, SavedOptions};
use crate::error::{Error, Result};
use crate::export::overwrite;
use crate::export::scene::{self, Format};
use crate::room;
use crate::room::generated::{self, Family};
use crate::room::photographs::{Rendering, STORED};
use crate::say;
use crate::study::trade::rooms::SIZE;
use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::{Args, ValueEnum};
use glam::DVec3;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub struct ExportArguments {
    #[command(flatten)]
    saved: SavedOptions,
    /// What to write
    #[arg(long, value_enum)]
    format: Format,
    /// Position of a probe in the capture's coordinates
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    at: Option<DVec3>,
    /// File to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    replace: Replace,
}

/// Name and help of a format on the command line.
fn described(format: Format) -> (&'static str, &'static str) {
    match format {
        Format::Glb => ("glb", "Scene with base colours and emissive strength"),
        Format::Obj => ("obj", "Scene as OBJ and MTL, with textures as images"),
        Format::Ply => ("ply", "Scene as PLY with vertex colours"),
        Format::Mitsuba => ("mitsuba", "Scene for Mitsuba 3"),
        Format::Csv => ("csv", "Table of objects"),
        Format::Probe { .. } => ("probe", "The light at a point as a panorama"),
    }
}

impl ValueEnum for Format {
    fn value_variants<'a>() -> &'a [Self] {
        const PROBE: Format = Format::Probe { at: DVec3::ZERO };
        use Format::{Csv, Glb, Mitsuba, Obj, Ply};
        &[Glb, Obj, Ply, Mitsuba, Csv, PROBE]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let (name, help) = described(*self);
        Some(PossibleValue::new(name).help(help))
    }
}

/// Refuses a path whose extension belongs to another format. An unknown extension is accepted.
fn check_extension(path: &Path, format: Format) -> Result<()> {
    let ending = path.extension().and_then(|ending| ending.to_str());
    let ending = ending.unwrap_or_default().to_ascii_lowercase();
    let is_of = |format: &Format| format.endings().contains(&ending.as_str());
    let other = Format::value_variants().iter().find(|other| is_of(other));
    let (Some(other), false) = (other, is_of(&format)) else {
        return Ok(());
    };
    let [(own, _), (other, _)] = [format, *other].map(described);
    let problem = format!("has the wrong extension for --format {own}");
    let endings = format.endings().join(" or .");
    let remedy = format!("use the extension .{endings}, or choose --format {other}");
    Err(Error::usage(path.display(), problem, remedy))
}

#[derive(Debug, Args)]
pub struct DemoArguments {
    /// Folder to write the capture into: new, or empty
    #[arg(long, value_name = "CAPTURE")]
    out: PathBuf,
    #[command(flatten)]
    replace: Replace,
    /// Write a generated room of this family instead of the built-in room; a scanned one without truth
    #[arg(long, value_name = "NAME", requires = "seed", conflicts_with = "samples",
          value_parser = PossibleValuesParser::new(Family::NAMES))]
    family: Option<String>,
    /// Render the photographs again with this random seed, instead of using those stored in the program; with --family, the number of the room
    #[arg(long, value_name = "N", value_parser = whole::<u64>)]
    seed: Option<u64>,
    /// Samples per pixel of photographs that are rendered again
    #[arg(long, value_name = "N", default_value_t = STORED.samples, requires = "seed",
          value_parser = from_one::<u32>)]
    samples: u32,
    /// Width in pixels of photographs that are rendered; their height is three quarters of it [default: 640; with --family, 96 as in `relit trade`]
    #[arg(long, value_name = "PIXELS", requires = "seed", value_parser = width)]
    width: Option<u32>,
}

/// Writes one file for another program.
pub fn export(arguments: &ExportArguments) -> Result<()> {
    arguments.replace.apply();
    check_extension(&arguments.out, arguments.format)?;
    overwrite::check(&arguments.out)?;
    let format = match (arguments.format, arguments.at) {
        (Format::Probe { .. }, None) => {
            let problem = "a probe needs a place";
            return Err(Error::usage("--format probe", problem, "add --at x,y,z"));
        }
        (Format::Probe { .. }, Some(at)) => Format::Probe { at },
        (format, _) => format,
    };
    let loaded = arguments.saved.load()?;
    let (scene, estimate) = (&loaded.capture.scene, &loaded.estimate);
    scene::write(scene, estimate, format, &arguments.out)?;
    if let Some(lost) = scene::lost(estimate, format) {
        say::warning(lost);
    }
    say::line(arguments.out.display());
    Ok(())
}

/// Writes the built-in room or a generated one, with its truth, as a capture.
pub fn demo(arguments: &DemoArguments) -> Result<()> {
    arguments.replace.apply();
    let family = arguments.family.as_deref().and_then(Family::of_name);
    let own_width = if family.is_some() {
        SIZE[0]
    } else {
        STORED.size[0]
    };
    let width = arguments.width.unwrap_or(own_width);
    let size = [width, width * 3 / 4];
    match (family, arguments.seed) {
        (Some(family), Some(seed)) => generated::write(&arguments.out, family, seed, size)?,
        (_, seed) => {
            let rendering = seed.map(|seed| Rendering::new(seed, arguments.samples, size));
            room::write(&arguments.out, rendering.as_ref())?;
        }
    }
    say::line(arguments.out.display());
    Ok(())
}
