//! The commands and their options.

use crate::capture::place::Coordinates;
use crate::cli::edit::EditArguments;
use crate::cli::evaluate::EvaluateArguments;
use crate::cli::export::{DemoArguments, ExportArguments};
use crate::cli::import::ImportArguments;
use crate::cli::insert::InsertArguments;
use crate::cli::interrupt::EXIT_CODES;
use crate::cli::object_values::named_color;
use crate::cli::parameters::{Parameters, duration};
use crate::cli::render::RenderArguments;
use crate::cli::study::StudyArguments;
use crate::cli::trade::TradeArguments;
use crate::export::overwrite;
use crate::inverse::held_out::HoldOut;
use crate::inverse::settings::Settings;
use crate::session::command::OpenOptions;
use crate::session::save::pictures::Frames;
use clap::{Args, Parser, Subcommand};
use glam::{DVec3, Vec3};
use std::path::PathBuf;
use std::time::Duration;

/// Recovers the lights and materials of a scanned room from photographs, and puts new objects into them.
#[derive(Debug, Parser)]
#[command(
    version,
    args_conflicts_with_subcommands = true,
    disable_help_subcommand = true,
    after_help = EXIT_CODES
)]
pub struct Arguments {
    /// Folder of the capture to open in the window; the built-in room if none is named
    pub capture: Option<PathBuf>,
    #[command(flatten)]
    pub solve: SolveOptions,
    #[command(subcommand)]
    pub action: Option<Action>,
}

/// What to do instead of opening the window.
#[derive(Debug, Subcommand)]
pub enum Action {
    /// Solve a capture without a window and write the results
    #[command(after_help = EXIT_CODES)]
    Solve(SolveArguments),
    /// Compare results with the truth of a capture
    Evaluate(EvaluateArguments),
    /// Render the room in its estimated light
    Render(RenderArguments),
    /// Put objects into a photograph
    #[command(after_help = EXIT_CODES)]
    Insert(InsertArguments),
    /// Switch lamps, recolour walls, and render the result
    #[command(after_help = EXIT_CODES)]
    Edit(EditArguments),
    /// Write the scene or its light for another program
    Export(ExportArguments),
    /// Turn a scan of another program into a capture
    Import(ImportArguments),
    /// Write the built-in room as a capture, with its truth
    Demo(DemoArguments),
    /// Measure what exactness costs in seconds, over presets and settings
    #[command(after_help = EXIT_CODES)]
    Trade(TradeArguments),
    /// Rerun experiments of the paper
    Study(StudyArguments),
}

/// `relit solve`.
#[derive(Debug, Args)]
pub struct SolveArguments {
    /// Folder of the capture
    pub capture: PathBuf,
    #[command(flatten)]
    pub solve: SolveOptions,
    #[command(flatten)]
    pub known: KnownValues,
}

/// What is known beforehand.
#[derive(Debug, Args)]
pub struct KnownValues {
    /// Radiance that an object is known to emit; held while the rest is solved
    #[arg(long, value_name = "NAME=R,G,B", value_parser = named_color)]
    pub known_emission: Vec<(String, Vec3)>,
    /// Diffuse reflectance, 0 to 1, that an object is known to have; held while the rest is solved
    #[arg(long, value_name = "NAME=R,G,B", value_parser = named_color)]
    pub known_albedo: Vec<(String, Vec3)>,
}

/// How to solve, and what to write.
#[derive(Debug, Args)]
pub struct SolveOptions {
    /// Folder to write into [default: relit-out/<capture>]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Threads to work with [default: one a core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,
    /// Go on from what an earlier solve left in the output folder
    #[arg(long)]
    pub resume: bool,
    /// Pictures to write: all frames at full size, N frames, or none [default: 16, long side 1024]
    #[arg(long, value_name = "all|N|none", value_parser = frames)]
    pub views: Option<Frames>,
    /// Time between two checkpoints, from which a killed solve goes on
    #[arg(long, value_name = "TIME", default_value = "8s", value_parser = time)]
    pub checkpoint: Duration,
    #[command(flatten)]
    pub replace: Replace,
    #[command(flatten)]
    pub read: ReadOptions,
    #[command(flatten)]
    pub parameters: Parameters,
}

/// What may be replaced.
#[derive(Debug, Args)]
pub struct Replace {
    /// Replace files of captures and results of other captures too
    #[arg(long)]
    overwrite: bool,
}

impl Replace {
    /// Lets the writers of files know.
    pub fn apply(&self) {
        if self.overwrite {
            overwrite::permit();
        }
    }
}

/// How to read a capture.
#[derive(Debug, Args)]
pub struct ReadOptions {
    /// Up axis of the capture [default: the cameras' mean up]
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    pub up: Option<DVec3>,
    /// Metres per unit of the capture's files [default: 1]
    #[arg(long, value_name = "METRES")]
    pub scale: Option<f64>,
    /// Segments that a mesh without objects is cut into, about, besides those that photographs show saturated
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub segments: Option<u64>,
    /// Let paths in the capture lead out of its folder; only for captures that you trust
    #[arg(long)]
    pub allow_outside: bool,
}

impl SolveOptions {
    /// The parameters that the options give, over the defaults.
    pub fn settings(&self) -> Settings {
        self.parameters.over(&Settings::default())
    }
}

impl ReadOptions {
    /// The same for the session, where a solve keeps pixels out of its fits.
    pub fn open(&self, settings: &Settings) -> OpenOptions {
        self.over(OpenOptions {
            hold_out: HoldOut::from(settings),
            ..OpenOptions::default()
        })
    }

    /// The same, with what is not said here as it was before.
    pub fn over(&self, before: OpenOptions) -> OpenOptions {
        OpenOptions {
            up: self.up.or(before.up),
            coordinates: Coordinates {
                scale: self.scale.or(before.coordinates.scale),
                ..before.coordinates
            },
            segments: self.segments.or(before.segments),
            allow_outside: self.allow_outside,
            ..before
        }
    }
}

/// Which frames get pictures: `all`, `none` or how many.
pub fn frames(text: &str) -> std::result::Result<Frames, String> {
    match text {
        "all" => Ok(Frames::All),
        "none" => Ok(Frames::AtMost(0)),
        _ => text
            .parse()
            .map(Frames::AtMost)
            .map_err(|_| "a number of frames, all or none is wanted".to_owned()),
    }
}

/// A whole number from 0.
pub fn whole(text: &str) -> std::result::Result<u64, String> {
    text.parse()
        .map_err(|_| "a whole number from 0 is wanted".to_owned())
}

/// A time such as 90, 60s or 5m.
pub fn time(text: &str) -> std::result::Result<Duration, String> {
    duration(text)
        .and_then(|seconds| Duration::try_from_secs_f64(seconds).ok())
        .ok_or_else(|| "a time such as 90, 60s, 5m or 1h is wanted".to_owned())
}

/// Three numbers with commas between.
pub fn triple(text: &str) -> std::result::Result<DVec3, String> {
    let numbers: Vec<f64> = text
        .split(',')
        .map(|part| part.trim().parse().ok().filter(|v: &f64| v.is_finite()))
        .collect::<Option<_>>()
        .unwrap_or_default();
    match numbers[..] {
        [x, y, z] => Ok(DVec3::new(x, y, z)),
        _ => Err("three numbers are wanted, e.g. 0,1,0".to_owned()),
    }
}
