//! `relit trade`: error over time of presets and settings, on a capture or on generated rooms.

use crate::cli::interrupt::Interrupt;
use crate::cli::numbers::{from_one, threads, whole};
use crate::cli::options::{ReadOptions, Replace, use_threads};
use crate::cli::parameters::duration;
use crate::error::{Error, Result};
use crate::inverse::settings::{Preset, Settings};
use crate::room::generated::Family;
use crate::say;
use crate::session::command::Source;
use crate::session::open::open;
use crate::session::snapshot::OpenCapture;
use crate::study::families::{self, Plan, RoomEvent, Row};
use crate::study::trade::plan::{self, Run};
use crate::study::trade::{Curve, SolveEvent, Trade, combine, measure, rooms};
use clap::Args;
use clap::builder::PossibleValuesParser;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Selects all families, or all presets.
const ALL: &str = "all";
/// Default time for all solves of curves.
const DEFAULT_TIME: Duration = Duration::from_secs(5 * 60);

#[derive(Debug, Args)]
pub struct TradeArguments {
    /// Folder of the capture; the built-in room if none is named
    capture: Option<PathBuf>,
    /// Folder to write into [default: relit-out/<capture>]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Solve N generated rooms of a family instead of a capture; with --presets or --around, the mean curve over plain ones
    #[arg(long, value_name = "N", conflicts_with = "capture", value_parser = from_one::<u64>)]
    rooms: Option<u64>,
    /// The family of the generated rooms, or all of them [default: plain]
    #[arg(long, value_name = "NAME", requires = "rooms", conflicts_with_all = ["presets", "around", "capture"], value_parser = PossibleValuesParser::new(Family::NAMES.into_iter().chain([ALL])))]
    family: Option<String>,
    /// The preset that generated rooms are solved with [default: balanced]
    #[arg(long, value_name = "PRESET", requires = "rooms", conflicts_with_all = ["presets", "around", "capture"], value_parser = PossibleValuesParser::new(Preset::WORDS))]
    preset: Option<String>,
    /// Time for all solves together, loading excluded [default: 5m]; of a family, no further room is started after it
    /// [default: none]
    #[arg(long, value_name = "TIME", value_parser = time)]
    time: Option<Duration>,
    /// Only the presets, without variations of their settings
    #[arg(long)]
    presets: bool,
    /// Only one preset and variations of its settings, with equal times; `all` for all presets and variations
    #[arg(long, value_name = "PRESET|all", conflicts_with = "presets", value_parser = PossibleValuesParser::new(Preset::WORDS.iter().copied().chain([ALL])))]
    around: Option<String>,
    /// Random seed, and seed of the first generated room
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole::<u64>)]
    seed: u64,
    /// Number of threads [default: one per core]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<u16>,
    #[command(flatten)]
    replace: Replace,
    #[command(flatten)]
    read: ReadOptions,
}

/// Parses a time above zero.
pub fn time(text: &str) -> std::result::Result<Duration, String> {
    let seconds = duration(text).filter(|seconds| *seconds > 0.0);
    let time = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    time.ok_or_else(|| "a time such as 90, 60s, 5m or 1h is wanted".to_owned())
}

impl TradeArguments {
    /// Seeds of `count` generated rooms.
    fn seeds(&self, count: u64) -> impl Iterator<Item = u64> {
        let first = self.seed;
        (0..count).map(move |index| first.wrapping_add(index))
    }

    /// The preset that generated rooms are solved with.
    fn preset(&self) -> Preset {
        let named = self.preset.as_deref();
        let preset = Preset::ALL.iter().find(|p| Some(p.word()) == named);
        preset.map_or(Settings::default().preset, |preset| *preset)
    }

    /// Time for all solves of curves.
    fn limit(&self) -> Duration {
        self.time.unwrap_or(DEFAULT_TIME)
    }
}

/// Measures and prints what was found. Writes trade.csv, trade.png and trade.json, or for families rooms.csv, rooms.png and
/// rooms.json. Returns the exit code.
pub fn trade(arguments: &TradeArguments) -> Result<i32> {
    arguments.replace.apply();
    use_threads(arguments.threads)?;
    let interrupt = Interrupt::listen()?;
    let rooms_folder = || Path::new("relit-out").join("generated-rooms");
    if let Some(count) = arguments.rooms
        && !arguments.presets
        && arguments.around.is_none()
    {
        let out = arguments.out.clone().unwrap_or_else(rooms_folder);
        of_families(arguments, &out, count, &interrupt)?;
        return Ok(interrupt.exit_code());
    }
    let base = Settings {
        seed: arguments.seed,
        ..Settings::default()
    };
    let runs = match &arguments.around {
        Some(preset) if preset != ALL => plan::around(preset, &base),
        Some(_) => plan::everything(&base),
        None if arguments.presets => plan::presets(&base),
        None => plan::everything(&base),
    };
    let (trade, folder) = match arguments.rooms {
        Some(count) => {
            let trade = over_rooms(arguments, count, &runs, &interrupt)?;
            (trade, rooms_folder())
        }
        None => {
            let folder = arguments.capture.clone();
            let source = folder.map_or(Source::BuiltInRoom, Source::Folder);
            let capture = open(&source, &arguments.read.open(&base))?.aligned()?;
            let trade = of_capture(arguments, &capture, &runs, &interrupt)?;
            (trade, source.default_out())
        }
    };
    let folder = arguments.out.clone().unwrap_or(folder);
    trade.write(&folder)?;
    say::table(&trade.words());
    say::line(format_args!("results in {}", folder.display()));
    Ok(interrupt.exit_code())
}

/// Solves generated rooms of the named families. Starts no further room after the time. Writes rooms.csv, rooms.json and
/// rooms.png, and prints a table.
fn of_families(
    arguments: &TradeArguments,
    out: &Path,
    count: u64,
    interrupt: &Interrupt,
) -> Result<()> {
    let family = arguments.family.as_deref().unwrap_or(Family::Plain.name());
    let named = |one: &Family| family == ALL || family == one.name();
    let plan = Plan {
        families: Family::ALL.into_iter().filter(named).collect(),
        seeds: arguments.seeds(count).collect(),
        size: rooms::SIZE,
        preset: arguments.preset(),
    };
    let started = Instant::now();
    let is_over = |time: Duration| started.elapsed() >= time;
    let stopped = || interrupt.requested() || arguments.time.is_some_and(is_over);
    let mut failed: Option<Error> = None;
    let summary = families::run(out, &plan, &stopped, &mut |event| match event {
        RoomEvent::Begins(family, seed) => {
            say::note(format_args!("{} room {seed} …", family.name()))
        }
        RoomEvent::Solved(row) => say::note(solved(row)),
        RoomEvent::Failed(error) => {
            say::note(error);
            failed.get_or_insert(error.clone());
        }
    })?;
    say::table(&summary.words());
    say::line(format_args!("results in {}", out.display()));
    failed.map_or(Ok(()), Err)
}

fn solved(row: &Row) -> String {
    let percent =
        |fraction: Option<f64>| fraction.map_or("-".to_owned(), |f| format!("{:.0} %", f * 100.0));
    let error = row.albedo_mae.map_or("-".to_owned(), |e| format!("{e:.4}"));
    format!(
        "{} room {}: albedo error {error} after {:.1} s, {} of {} lamps, {} false, {} within two standard errors",
        row.family.name(),
        row.seed,
        row.seconds,
        row.lamps_found,
        row.lamps_true,
        row.lamps_false,
        percent(row.coverage_2)
    )
}

fn of_capture(
    arguments: &TradeArguments,
    capture: &OpenCapture,
    runs: &[Run],
    interrupt: &Interrupt,
) -> Result<Trade> {
    let summary = capture.summary.join(", ");
    say::note(format_args!("{}: {summary}", capture.name));
    let (problem, metric) = (capture.problem(), capture.metric()?);
    let started = Instant::now();
    let (limit, stopped) = (arguments.limit(), || interrupt.requested());
    let tell = &mut print_progress;
    let curves = measure(&problem, &metric, runs, limit, &stopped, tell)?;
    let (hash, seconds) = (Some(capture.hash.clone()), started.elapsed());
    let measure = metric.measure();
    Ok(Trade::new(&capture.name, hash, measure, seconds, curves))
}

fn over_rooms(
    arguments: &TradeArguments,
    count: u64,
    runs: &[Run],
    interrupt: &Interrupt,
) -> Result<Trade> {
    let mut measured = Vec::new();
    let mut seconds = Duration::ZERO;
    for seed in arguments.seeds(count) {
        say::note(format_args!("generated room {seed}"));
        let (problem, metric) = rooms::problem(seed, rooms::SIZE)?;
        let started = Instant::now();
        let limit = arguments.limit().div_f64(count as f64);
        let (stopped, tell) = (|| interrupt.requested(), &mut print_progress);
        let curves = measure(&problem, &metric, runs, limit, &stopped, tell)?;
        seconds += started.elapsed();
        // Drop a room that was interrupted: its solves are incomplete.
        if interrupt.requested() {
            break;
        }
        measured.push(curves);
    }
    let name = format!("generated rooms from {}", arguments.seed);
    let measure = crate::study::trade::Measure::Albedo;
    let curves = combine::combine(&measured);
    let mut trade = Trade::new(&name, None, measure, seconds, curves);
    trade.captures = measured.len() as u64;
    Ok(trade)
}

/// Prints a line when a solve begins and when it ends.
fn print_progress(event: SolveEvent) {
    match event {
        SolveEvent::Begins(run) => say::note(format_args!("{} …", run.name)),
        SolveEvent::Ended(curve) => say::note(format_args!("{}: {}", curve.name, ending(curve))),
    }
}

fn ending(curve: &Curve) -> String {
    match (curve.points.last(), curve.ended) {
        (Some(end), Some(why)) => {
            let (error, seconds, why) = (end.error, end.seconds, why.word());
            format!("error {error:.5} after {seconds:.2} s ({why})")
        }
        _ => "no estimate in its time".to_owned(),
    }
}
