//! The commands and their options.

use crate::calibrate::held_out::HoldOut;
use crate::capture::orientation::Orientation;
use crate::capture::place::Coordinates;
use crate::capture::reading::{Axes, Reading};
use crate::cli::edit::EditArguments;
use crate::cli::evaluate::EvaluateArguments;
use crate::cli::export::{DemoArguments, ExportArguments};
use crate::cli::import::ImportArguments;
use crate::cli::insert::InsertArguments;
use crate::cli::interrupt::EXIT_CODES;
use crate::cli::numbers::{above_zero, from_one, quarters, shift, threads, triple};
use crate::cli::object_values::named_color;
use crate::cli::parameters::{Parameters, duration};
use crate::cli::render::RenderArguments;
use crate::cli::study::StudyArguments;
use crate::cli::trade::TradeArguments;
use crate::error::{Error, Result};
use crate::export::overwrite;
use crate::inverse::settings::Settings;
use crate::render::{Device, Renderer};
use crate::say;
use crate::session::command::OpenOptions;
use crate::session::save::pictures::Frames;
use crate::transport::denoise::Denoiser;
use clap::{Arg, Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};
use glam::{DVec3, Vec3};
use std::ffi::OsString;
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
    /// What to open in the window: a capture, a scan of another program, or results to go on from; the built-in room if none is named
    pub capture: Option<PathBuf>,
    #[command(flatten)]
    pub solve: SolveOptions,
    #[command(subcommand)]
    pub action: Option<Action>,
}

impl Arguments {
    /// Reads a command line; its first word is the program.
    ///
    /// # Errors
    /// It is no such line, or asks for help.
    pub fn from_words<W: Into<OsString> + Clone>(
        words: impl IntoIterator<Item = W>,
    ) -> std::result::Result<Self, clap::Error> {
        // A number below zero is the value of the option before it, for which it may be wrong, and no option.
        let numbers = |argument: Arg| match argument.is_positional() {
            true => argument,
            false => {
                let takes_one = argument.get_action().takes_values();
                argument.allow_negative_numbers(takes_one)
            }
        };
        let command = Self::command().mut_args(numbers);
        let command = command.mut_subcommands(|command| command.mut_args(numbers));
        Self::from_arg_matches(&command.try_get_matches_from(words)?)
    }
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
    /// A capture, a scan of another program (imported first, into relit-out/<scan>/capture), or results to go on from
    pub capture: PathBuf,
    #[command(flatten)]
    pub solve: SolveOptions,
    #[command(flatten)]
    pub known: KnownValues,
}

/// Whether pictures are smoothed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Denoise {
    /// Pictures that people look at are, measurements are not
    Auto,
    /// Always, by relit's own denoiser
    Builtin,
    /// Always, by Open Image Denoise
    Oidn,
    /// Never
    None,
}

/// Whether the noise of pictures is smoothed.
#[derive(Debug, Clone, Copy, Args)]
pub struct DenoiseOptions {
    /// Takes out noise, guided by what each pixel sees; `auto` does so in pictures to look at, by Open Image Denoise where it is installed, and leaves radiance in .exr as it was rendered
    #[arg(long, value_name = "HOW", default_value = "auto", default_missing_value = "builtin", num_args = 0..=1)]
    denoise: Denoise,
}

impl DenoiseOptions {
    /// What denoises a picture that is there to be looked at, or to measure by; `None` where nothing does.
    ///
    /// # Errors
    /// Open Image Denoise is asked for and is not installed.
    pub fn denoiser(self, to_look_at: bool) -> Result<Option<Denoiser>> {
        Ok(match self.denoise {
            Denoise::Auto => to_look_at.then(Denoiser::best),
            Denoise::Builtin => Some(Denoiser::Builtin),
            Denoise::None => None,
            Denoise::Oidn => match Denoiser::best() {
                Denoiser::Oidn => Some(Denoiser::Oidn),
                Denoiser::Builtin => {
                    return Err(Error::new(
                        "--denoise oidn",
                        "the library of Open Image Denoise 2 is not found",
                        "install it, name its file in RELIT_OIDN, or pass --denoise builtin",
                    ));
                }
            },
        })
    }
}

/// What traces the paths of pictures.
#[derive(Debug, Clone, Copy, Args)]
pub struct DeviceOptions {
    /// What traces paths: a graphics card where there is one and else the processor, the processor, or any graphics adapter
    #[arg(long, value_name = "auto|cpu|gpu", default_value = "auto", value_parser = str::parse::<Device>)]
    pub device: Device,
}

impl DeviceOptions {
    /// Finds it, and says what was found where a person asked or a card is used.
    ///
    /// # Errors
    /// There is none.
    pub fn renderer(self) -> Result<Renderer> {
        let renderer = Renderer::find(self.device)?;
        match (renderer.card(), self.device) {
            (Some(card), _) => say::aside(format_args!("paths traced by {card}")),
            (None, Device::Cpu) => say::aside("paths traced by the processor"),
            (None, _) => {}
        }
        Ok(renderer)
    }
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
    #[arg(long, value_name = "N", value_parser = threads)]
    pub threads: Option<u16>,
    /// Go on from what an earlier solve left in the output folder
    #[arg(long)]
    pub resume: bool,
    /// Pictures to write: all frames at full size, N frames, or none [default: 16, long side 1024]
    #[arg(long, value_name = "all|N|none", value_parser = frames)]
    pub views: Option<Frames>,
    #[command(flatten)]
    pub denoise: DenoiseOptions,
    #[command(flatten)]
    pub device: DeviceOptions,
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
    #[command(flatten)]
    pub reading: ReadingOptions,
    /// Solve even where the photographs do not show the mesh from their poses
    #[arg(long)]
    pub trust_poses: bool,
    /// Up axis of the capture [default: the cameras' mean up]
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    pub up: Option<DVec3>,
    /// Metres per unit of the capture's files [default: 1]
    #[arg(long, value_name = "METRES", value_parser = above_zero)]
    pub scale: Option<f64>,
    /// Segments that a mesh without objects is cut into, about, besides those that photographs show saturated
    #[arg(long, value_name = "N", value_parser = from_one::<u64>)]
    pub segments: Option<u64>,
    /// Let paths in the capture lead out of its folder; only for captures that you trust
    #[arg(long)]
    pub allow_outside: bool,
}

/// How the numbers of a capture's files are meant, where they follow other conventions than the format's.
#[derive(Debug, Args)]
pub struct ReadingOptions {
    /// Axes of the poses: x right, y up, looking down -z (opengl), or x right, y down, looking down +z (opencv)
    #[arg(long, value_name = "AXES", value_parser = ["opengl", "opencv"])]
    pub axes: Option<String>,
    /// Turn the mesh about the x axis by so many degrees, to agree with the poses
    #[arg(long, value_name = "90|180|270", value_parser = quarters)]
    pub mesh_turn: Option<u8>,
    /// Multiply the mesh's coordinates, to be in the unit of the poses
    #[arg(long, value_name = "FACTOR", value_parser = above_zero)]
    pub mesh_scale: Option<f64>,
    /// Multiply all focal lengths
    #[arg(long, value_name = "FACTOR", value_parser = above_zero)]
    pub focal: Option<f64>,
    /// Multiply focal lengths and principal points, for photographs of another size than the lens is given for
    #[arg(long, value_name = "FACTOR", value_parser = above_zero)]
    pub lens_scale: Option<f64>,
    /// Turn all photographs clockwise by so many degrees
    #[arg(long, value_name = "90|180|270", value_parser = quarters)]
    pub turn: Option<u8>,
    /// Exchange left and right of all photographs
    #[arg(long)]
    pub mirror: bool,
    /// Give each pose the photograph of the frame N later
    #[arg(long, value_name = "N", value_parser = shift)]
    pub shift: Option<i32>,
}

impl ReadingOptions {
    /// The same, with what is not said here as it was before.
    fn over(&self, before: Reading) -> Reading {
        let axes = match self.axes.as_deref() {
            Some("opencv") => Axes::OpenCv,
            Some(_) => Axes::OpenGl,
            None => before.axes,
        };
        let orientation = match (self.turn, self.mirror) {
            (None, false) => before.orientation,
            (turns, mirrored) => Orientation {
                turns: turns.unwrap_or(0),
                mirrored,
            },
        };
        Reading {
            axes,
            mesh_turns: self.mesh_turn.unwrap_or(before.mesh_turns),
            mesh_scale: self.mesh_scale.unwrap_or(before.mesh_scale),
            focal: self.focal.unwrap_or(before.focal),
            lens_scale: self.lens_scale.unwrap_or(before.lens_scale),
            orientation,
            shift: self.shift.unwrap_or(before.shift),
        }
    }
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
            check_alignment: !self.trust_poses,
            ..OpenOptions::default()
        })
    }

    /// The same, with what is not said here as it was before.
    pub fn over(&self, before: OpenOptions) -> OpenOptions {
        OpenOptions {
            up: self.up.or(before.up),
            reading: self.reading.over(before.reading),
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

/// A time such as 90, 60s or 5m.
pub fn time(text: &str) -> std::result::Result<Duration, String> {
    duration(text)
        .and_then(|seconds| Duration::try_from_secs_f64(seconds).ok())
        .ok_or_else(|| "a time such as 90, 60s, 5m or 1h is wanted".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is said where an option of a command is given a value.
    fn said(command: &str, option: &str, value: &str) -> String {
        let words = ["relit", command, option, value];
        Arguments::from_words(words).map_or_else(|error| error.to_string(), |_| String::new())
    }

    #[test]
    fn a_wrong_number_is_answered_with_the_option_the_value_and_what_is_wanted() {
        let command = Arguments::command();
        let mut numbers = 0;
        for command in command.get_subcommands() {
            let takes_one = |argument: &&Arg| {
                let none = argument.get_num_args().is_some_and(|n| !n.takes_values());
                argument.get_action().takes_values() && !none
            };
            let options = command.get_arguments().filter(takes_one);
            for option in options.filter_map(|argument| argument.get_long()) {
                let option = format!("--{option}");
                for value in ["-1", "a"] {
                    let said = said(command.get_name(), &option, value);
                    let vague = [
                        "unexpected argument",
                        "invalid digit",
                        "invalid float",
                        "is not in",
                    ];
                    assert!(!vague.iter().any(|words| said.contains(words)), "{said}");
                    let named = said.contains(&option) && said.contains(&format!("'{value}'"));
                    numbers += u32::from(named && said.contains("wanted"));
                }
            }
        }
        assert!(numbers > 60, "{numbers}");
        for (option, value, wanted) in [
            ("--shift", "a", "a whole number such as 1 or -1 is wanted"),
            ("--focal", "-1", "a number above 0 is wanted"),
            ("--mesh-scale", "0", "a number above 0 is wanted"),
            ("--turn", "45", "90, 180 or 270 is wanted"),
            ("--threads", "0", "a whole number from 1 to 65535 is wanted"),
        ] {
            let said = said("solve", option, value);
            assert!(
                said.contains(option) && said.contains(value) && said.contains(wanted),
                "{said}"
            );
        }
    }
}
