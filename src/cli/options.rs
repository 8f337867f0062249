//! Groups of options that several commands share.

use crate::calibrate::held_out::HoldOut;
use crate::capture::orientation::Orientation;
use crate::capture::place::Coordinates;
use crate::capture::reading::{Axes, Reading};
use crate::cli::numbers::{above_zero, from_one, quarters, shift, threads, triple};
use crate::cli::parameters::{Parameters, duration};
use crate::error::{Error, Result};
use crate::export::overwrite;
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::render::{Device, Renderer};
use crate::say;
use crate::session::command::{OpenOptions, Source};
use crate::session::edits::Edits;
use crate::session::open::open;
use crate::session::save::pictures::Frames;
use crate::session::save::{self, Saved};
use crate::session::snapshot::OpenCapture;
use crate::transport::denoise::Denoiser;
use clap::{Args, ValueEnum};
use glam::DVec3;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// Which pictures are denoised.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Denoise {
    /// Pictures for viewing, not measurements
    Auto,
    /// Always, by relit's own denoiser
    Builtin,
    /// Always, by Open Image Denoise
    Oidn,
    /// Never
    None,
}

/// Denoising of pictures.
#[derive(Debug, Clone, Copy, Args)]
pub struct DenoiseOptions {
    /// Denoise pictures; `auto` denoises all but renders written as .exr, by Open Image Denoise if it is installed
    #[arg(long, value_name = "HOW", default_value = "auto", default_missing_value = "builtin", num_args = 0..=1)]
    denoise: Denoise,
}

impl DenoiseOptions {
    /// The denoiser of a picture; `None` for none. `to_look_at`: it is meant for viewing, not for measuring.
    pub fn denoiser(self, to_look_at: bool) -> Result<Option<Denoiser>> {
        if self.denoise == Denoise::Oidn && Denoiser::best() != Denoiser::Oidn {
            let problem = "the library of Open Image Denoise 2 is not found";
            let remedy = "install it, name its file in RELIT_OIDN, or pass --denoise builtin";
            return Err(Error::new("--denoise oidn", problem, remedy));
        }
        Ok(match self.denoise {
            Denoise::Auto => to_look_at.then(Denoiser::best),
            Denoise::Builtin => Some(Denoiser::Builtin),
            Denoise::Oidn => Some(Denoiser::Oidn),
            Denoise::None => None,
        })
    }
}

/// What traces the paths of pictures.
#[derive(Debug, Clone, Copy, Args)]
pub struct DeviceOptions {
    /// What traces paths: a graphics card if there is one, else the processor (auto); the processor (cpu); any
    /// graphics adapter (gpu)
    #[arg(long, value_name = "auto|cpu|gpu", default_value = "auto", value_parser = str::parse::<Device>)]
    pub device: Device,
}

impl DeviceOptions {
    /// Finds the renderer. Prints its name if it is a graphics card, or if the processor was asked for by name.
    pub fn renderer(self) -> Result<Renderer> {
        let renderer = Renderer::find(self.device)?;
        match (renderer.card(), self.device) {
            (Some(card), _) => say::note(format_args!("paths traced by {card}")),
            (None, Device::Cpu) => say::note("paths traced by the processor"),
            (None, _) => {}
        }
        Ok(renderer)
    }
}

/// Options of a solve.
#[derive(Debug, Args)]
pub struct SolveOptions {
    /// Folder to write into [default: relit-out/<capture>]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Number of threads [default: one per core]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub threads: Option<u16>,
    /// Resume the earlier solve in the output folder
    #[arg(long)]
    pub resume: bool,
    /// Pictures to write: all frames at full size, N frames, or none [default: 16, long side 1024]
    #[arg(long, value_name = "all|N|none", value_parser = frames)]
    pub views: Option<Frames>,
    #[command(flatten)]
    pub denoise: DenoiseOptions,
    #[command(flatten)]
    pub device: DeviceOptions,
    /// Time between checkpoints, from which a killed solve can be resumed
    #[arg(long, value_name = "TIME", default_value = "8s", value_parser = time)]
    pub checkpoint: Duration,
    #[command(flatten)]
    pub replace: Replace,
    #[command(flatten)]
    pub read: ReadOptions,
    #[command(flatten)]
    pub parameters: Parameters,
}

/// Permission to replace files.
#[derive(Debug, Args)]
pub struct Replace {
    /// Also replace files of captures, and results of other captures
    #[arg(long)]
    overwrite: bool,
}

impl Replace {
    /// Permits all file writers to replace what they refuse to by default.
    pub fn apply(&self) {
        if self.overwrite {
            overwrite::permit();
        }
    }
}

/// Options for reading a capture.
#[derive(Debug, Args)]
pub struct ReadOptions {
    /// Axes of the poses: x right, y up, looking down -z (opengl), or x right, y down, looking down +z (opencv)
    #[arg(long, value_name = "AXES", value_parser = ["opengl", "opencv"])]
    pub axes: Option<String>,
    /// Rotate the mesh about the x axis by this many degrees, to match the poses
    #[arg(long, value_name = "90|180|270", value_parser = quarters)]
    pub mesh_turn: Option<u8>,
    /// Scale the mesh's coordinates to the unit of the poses
    #[arg(long, value_name = "FACTOR", value_parser = above_zero)]
    pub mesh_scale: Option<f64>,
    /// Scale all focal lengths
    #[arg(long, value_name = "FACTOR", value_parser = above_zero)]
    pub focal: Option<f64>,
    /// Scale focal lengths and principal points, for photographs of another size than the intrinsics are for
    #[arg(long, value_name = "FACTOR", value_parser = above_zero)]
    pub lens_scale: Option<f64>,
    /// Rotate all photographs clockwise by this many degrees
    #[arg(long, value_name = "90|180|270", value_parser = quarters)]
    pub turn: Option<u8>,
    /// Mirror all photographs horizontally
    #[arg(long)]
    pub mirror: bool,
    /// Use for each pose the photograph of the frame N later
    #[arg(long, value_name = "N", value_parser = shift)]
    pub shift: Option<i32>,
    /// Solve even if the photographs do not seem to show the mesh from their poses
    #[arg(long)]
    pub trust_poses: bool,
    /// Up axis of the capture [default: the cameras' mean up]
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    pub up: Option<DVec3>,
    /// Metres per unit of the capture's files [default: 1]
    #[arg(long, value_name = "METRES", value_parser = above_zero)]
    pub scale: Option<f64>,
    /// About how many segments to cut a mesh without objects into; what photographs show saturated gets segments of its own
    #[arg(long, value_name = "N", value_parser = from_one::<u64>)]
    pub segments: Option<u64>,
    /// Let paths in the capture lead out of its folder; only for captures that you trust
    #[arg(long)]
    pub allow_outside: bool,
}

impl ReadOptions {
    /// The conventions of a capture's files over `before`: what is not given keeps its value.
    fn reading(&self, before: Reading) -> Reading {
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

    /// Options for opening a capture that is solved with `settings`, which hold pixels out of the fit.
    pub fn open(&self, settings: &Settings) -> OpenOptions {
        self.over(OpenOptions {
            hold_out: HoldOut::from(settings),
            check_alignment: !self.trust_poses,
            ..OpenOptions::default()
        })
    }

    /// These options over `before`: what is not given keeps its value.
    pub fn over(&self, before: OpenOptions) -> OpenOptions {
        OpenOptions {
            up: self.up.or(before.up),
            reading: self.reading(before.reading),
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

/// Which results to load.
#[derive(Debug, Args)]
pub struct SavedOptions {
    /// Folder that relit solve wrote
    pub dir: PathBuf,
    /// Where the capture is now, if it was moved
    #[arg(long, value_name = "DIR")]
    pub capture: Option<PathBuf>,
    /// Number of threads [default: one per core]
    #[arg(long, value_name = "N", value_parser = threads)]
    pub threads: Option<u16>,
    /// Let paths in the capture lead out of its folder; only for captures that you trust
    #[arg(long)]
    pub allow_outside: bool,
}

/// Results with their capture.
pub struct Loaded {
    pub saved: Saved,
    pub capture: Arc<OpenCapture>,
    pub found: Arc<Estimate>,
    pub edits: Edits,
    /// The estimate with the edits.
    pub estimate: Arc<Estimate>,
}

impl SavedOptions {
    /// Loads the results and opens their capture.
    pub fn load(&self) -> Result<Loaded> {
        use_threads(self.threads)?;
        let saved = save::load(&self.dir)?;
        let moved = self.capture.clone().map(Source::Folder);
        let options = OpenOptions {
            allow_outside: self.allow_outside,
            ..saved.options.clone()
        };
        let capture = open(moved.as_ref().unwrap_or(&saved.source), &options)?;
        let found = saved.estimate_for(&capture)?;
        let edits = saved.edits_for(&capture)?;
        Ok(Loaded {
            saved,
            capture: Arc::new(capture),
            estimate: Arc::new(edits.apply(&found)),
            found: Arc::new(found),
            edits,
        })
    }
}

/// More threads per core than this gain nothing: an idle worker scans the list of all threads for work, which takes most of the
/// time with a thousand of them.
const MAX_THREADS_A_CORE: usize = 4;

/// Sets the number of worker threads of the process. Warns if fewer are used than `threads`.
pub fn use_threads(threads: Option<u16>) -> Result<()> {
    let Some(threads) = threads.map(usize::from) else {
        return Ok(());
    };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let used = threads.min(cores * MAX_THREADS_A_CORE);
    if used < threads {
        say::warning(format_args!(
            "--threads {threads}: {used} are used, {MAX_THREADS_A_CORE} for each of the machine's {cores} cores"
        ));
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(used);
    let built = pool.build_global();
    built.map_err(|error| Error::new("--threads", error, "name fewer threads"))
}

/// Parses which frames get pictures: `all`, `none` or a count.
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

/// Parses a time such as 90, 60s or 5m.
pub fn time(text: &str) -> std::result::Result<Duration, String> {
    duration(text)
        .and_then(|seconds| Duration::try_from_secs_f64(seconds).ok())
        .ok_or_else(|| "a time such as 90, 60s, 5m or 1h is wanted".to_owned())
}
