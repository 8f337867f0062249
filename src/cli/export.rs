//! `relit export` and `relit demo`: files for other programs, and the built-in room as a capture.

use crate::cli::numbers::{from_one, triple, whole, width};
use crate::cli::options::Replace;
use crate::cli::saved::{Loaded, SavedOptions};
use crate::error::{Error, Result};
use crate::export::overwrite;
use crate::export::scene::{self, Format};
use crate::room;
use crate::room::photographs::{Rendering, STORED};
use crate::say;
use clap::{Args, ValueEnum};
use glam::DVec3;
use std::path::{Path, PathBuf};

/// `relit export`.
#[derive(Debug, Args)]
pub struct ExportArguments {
    #[command(flatten)]
    saved: SavedOptions,
    /// What to write
    #[arg(long, value_enum)]
    format: FormatName,
    /// Position of a probe in the capture's coordinates
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    at: Option<DVec3>,
    /// File to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    replace: Replace,
}

/// The formats by their names on the command line.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum FormatName {
    /// Scene with base colours and emissive strength
    Glb,
    /// Scene as OBJ and MTL, with textures as images
    Obj,
    /// Scene as PLY with vertex colours
    Ply,
    /// Scene for Mitsuba 3
    Mitsuba,
    /// Table of objects
    Csv,
    /// The light at a point as a panorama
    Probe,
}

impl FormatName {
    /// The format; a probe is taken at `at`.
    fn format(self, at: DVec3) -> Format {
        match self {
            Self::Glb => Format::Glb,
            Self::Obj => Format::Obj,
            Self::Ply => Format::Ply,
            Self::Mitsuba => Format::Mitsuba,
            Self::Csv => Format::Csv,
            Self::Probe => Format::Probe { at },
        }
    }

    /// File extensions of the format.
    fn endings(self) -> &'static [&'static str] {
        self.format(DVec3::ZERO).endings()
    }

    /// Refuses a path whose extension belongs to another format. An unknown extension is accepted.
    fn check(self, path: &Path) -> Result<()> {
        let ending = path.extension().and_then(|ending| ending.to_str());
        let ending = ending.unwrap_or_default().to_ascii_lowercase();
        let is_of = |word: &Self| word.endings().contains(&ending.as_str());
        let other = Self::value_variants().iter().find(|word| is_of(word));
        let (Some(other), false) = (other, is_of(&self)) else {
            return Ok(());
        };
        let name = |word: Self| {
            word.to_possible_value()
                .map_or(String::new(), |v| v.get_name().to_owned())
        };
        Err(Error::usage(
            path.display(),
            format!("has the wrong extension for --format {}", name(self)),
            format!(
                "use the extension .{}, or choose --format {}",
                self.endings().join(" or ."),
                name(*other)
            ),
        ))
    }
}

/// `relit demo`.
#[derive(Debug, Args)]
pub struct DemoArguments {
    /// Folder to write the capture into: new, or empty
    #[arg(long, value_name = "CAPTURE")]
    out: PathBuf,
    #[command(flatten)]
    replace: Replace,
    /// Render the photographs again with this random seed, instead of using those stored in the program
    #[arg(long, value_name = "N", value_parser = whole::<u64>)]
    seed: Option<u64>,
    /// Samples per pixel of photographs that are rendered again
    #[arg(long, value_name = "N", default_value_t = STORED.samples, requires = "seed",
          value_parser = from_one::<u32>)]
    samples: u32,
    /// Width in pixels of photographs that are rendered again; their height is three quarters of it
    #[arg(long, value_name = "PIXELS", default_value_t = STORED.size[0], requires = "seed",
          value_parser = width)]
    width: u32,
}

/// Writes one file for another program.
///
/// # Errors
/// The results cannot be read, or the file cannot be written.
pub fn export(arguments: &ExportArguments) -> Result<()> {
    arguments.replace.apply();
    arguments.format.check(&arguments.out)?;
    overwrite::check(&arguments.out)?;
    if matches!(arguments.format, FormatName::Probe) && arguments.at.is_none() {
        return Err(Error::usage(
            "--format probe",
            "a probe needs a place",
            "add --at x,y,z",
        ));
    }
    let format = arguments.format.format(arguments.at.unwrap_or_default());
    let Loaded {
        capture, estimate, ..
    } = arguments.saved.load()?;
    scene::write(&capture.scene, &estimate, format, &arguments.out)?;
    if let Some(lost) = scene::lost(&estimate, format) {
        say::warning(lost);
    }
    say::line(arguments.out.display());
    Ok(())
}

/// Writes the built-in room with its truth as a capture.
///
/// # Errors
/// The folder cannot be written.
pub fn demo(arguments: &DemoArguments) -> Result<()> {
    arguments.replace.apply();
    let rendering = arguments.seed.map(|seed| Rendering {
        seed,
        samples: arguments.samples,
        size: [arguments.width, arguments.width * 3 / 4],
    });
    room::write(&arguments.out, rendering.as_ref())?;
    say::line(arguments.out.display());
    Ok(())
}
