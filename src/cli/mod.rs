//! The command line: commands, progress, errors on one line.

mod arguments;
mod edit;
mod evaluate;
mod export;
mod import;
mod insert;
mod interrupt;
mod numbers;
mod object_values;
mod options;
mod parameters;
mod progress;
mod render;
mod solve;
mod study;
mod trade;

use crate::error::{Error, Result};
use crate::inverse::settings::Settings;
use crate::render::Device;
use crate::say;
use crate::session::command::{PathKind, Source, Start};
use crate::session::save;
use arguments::{Action, Arguments};
use clap::CommandFactory;
use clap::error::ErrorKind;
use object_values::ObjectValues;
use options::SolveOptions;
use std::path::Path;

/// Typing errors (letters wrong, missing or swapped) up to which a word is matched to a command.
const MAX_TYPOS: usize = 2;

/// Opens the window; returns when it is closed.
pub type Window = fn(Option<Start>, Settings, Device) -> Result<()>;

/// Runs the program with the process's arguments. Returns the exit code: 0 done, 1 an error, 2 wrong usage, 128 + n terminated
/// by signal n.
///
/// `window` is `None` in builds without a window; only the plain `relit` command needs it.
pub fn run(window: Option<Window>) -> i32 {
    let outcome = match Arguments::from_words(std::env::args_os()) {
        Ok(arguments) => act(arguments, window),
        Err(error) => match error.kind() {
            ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
                // Nothing can be done if help cannot be printed.
                let _ = error.print();
                return 0;
            }
            _ => Err(misspelt_command().unwrap_or_else(|| usage_error(&error))),
        },
    };
    match outcome {
        Ok(code) => code,
        Err(error) => {
            say::note(format_args!("error: {error}"));
            error.exit_code()
        }
    }
}

/// The commands with their options, as the manual lists them.
pub fn command() -> clap::Command {
    Arguments::command()
}

/// Checks a command line, given as its words without `relit` in front.
///
/// # Errors
/// The command line is wrong, or asks for help or the version.
pub fn check(words: &[&str]) -> std::result::Result<(), clap::Error> {
    Arguments::from_words(std::iter::once(&"relit").chain(words)).map(drop)
}

/// Runs the command. Returns the exit code: 0, or that of an interrupt.
fn act(arguments: Arguments, window: Option<Window>) -> Result<i32> {
    let done = |()| 0;
    match arguments.action {
        None => open(arguments, window),
        Some(Action::Evaluate(evaluate)) => evaluate::evaluate(&evaluate).map(done),
        Some(Action::Render(render)) => render::render(&render).map(done),
        Some(Action::Insert(insert)) => insert::insert(&insert),
        Some(Action::Export(files)) => export::export(&files).map(done),
        Some(Action::Import(scan)) => import::import(&scan).map(done),
        Some(Action::Demo(demo)) => export::demo(&demo).map(done),
        Some(Action::Edit(edit)) => edit::edit(&edit),
        Some(Action::Trade(measured)) => trade::trade(&measured),
        Some(Action::Study(studied)) => study::study(&studied).map(done),
        Some(Action::Solve(capture)) => {
            let known = ObjectValues {
                emission: capture.known_emission,
                albedo: capture.known_albedo,
                ..ObjectValues::default()
            };
            let mut options = capture.solve;
            let source = source_of(&capture.capture, &mut options)?;
            solve::solve(&source, &options, &known)
        }
    }
}

/// The error for a first word that is a misspelt command; clap takes it for the capture.
fn misspelt_command() -> Option<Error> {
    let first = std::env::args_os().nth(1)?;
    let first = first.to_str().filter(|word| !word.starts_with('-'))?;
    let is_command = |name: &str| Arguments::command().find_subcommand(name).is_some();
    if is_command(first) || Path::new(first).exists() {
        return None;
    }
    // Only options may follow a capture's path.
    let second = std::env::args_os().nth(2);
    let extra = second.is_some_and(|word| !word.to_string_lossy().starts_with('-'));
    similar_command(first).or_else(|| extra.then(|| unknown_command(first, "see relit --help")))
}

/// The error for a word that is close to a command's name.
fn similar_command(word: &str) -> Option<Error> {
    let command = Arguments::command();
    let names = command.get_subcommands().map(|known| known.get_name());
    let distances = names.map(|name| (strsim::osa_distance(word, name), name));
    let (distance, name) = distances.min()?;
    // At most MAX_TYPOS errors, and fewer than half of the letters.
    let near = distance <= MAX_TYPOS && 2 * distance < name.len();
    near.then(|| unknown_command(word, &format!("did you mean '{name}'?")))
}

fn unknown_command(word: &str, remedy: &str) -> Error {
    let problem = format!("unknown command '{word}', and there is no such folder");
    Error::usage("command line", problem, remedy)
}

/// `relit [CAPTURE]`: opens the window, or solves headless if there is no display.
fn open(arguments: Arguments, window: Option<Window>) -> Result<i32> {
    if let Some(folder) = arguments.capture.as_ref().filter(|folder| !folder.exists())
        && let Some(error) = folder.to_str().and_then(similar_command)
    {
        return Err(error);
    }
    let mut options = arguments.solve;
    let source = match &arguments.capture {
        None => Source::BuiltInRoom,
        Some(path) => source_of(path, &mut options)?,
    };
    let reason = match window {
        None => "this build has no window".to_owned(),
        Some(_) if !has_display() => "no display".to_owned(),
        Some(window) => {
            options::use_threads(options.threads)?;
            let settings = options.parameters.over(&Settings::default());
            let start = match options.out.clone().filter(|_| options.resume) {
                Some(results) => Start::Results(results),
                None => Start::Capture(source.clone(), options.read.open(&settings)),
            };
            match window(Some(start), settings, options.device.device) {
                Ok(()) => return Ok(0),
                Err(error) => error.to_string(),
            }
        }
    };
    say::note(format_args!("relit: {reason}; solving without a window"));
    solve::solve(&source, &options, &ObjectValues::default())
}

/// The source that a path names. A scan is imported first. For results, `options` are changed to resume them.
fn source_of(path: &Path, options: &mut SolveOptions) -> Result<Source> {
    match PathKind::at(path)? {
        PathKind::Capture(folder) => Ok(Source::Folder(folder)),
        PathKind::Results(folder) => {
            let source = save::load_checkpoint(&folder)?.source;
            say::note(format_args!("going on from {}", folder.display()));
            options.out.get_or_insert(folder);
            options.resume = true;
            Ok(source)
        }
        PathKind::Scan(scan) => import::beside_results(&scan).map(Source::Folder),
    }
}

/// Whether a display for the window may exist.
fn has_display() -> bool {
    let named = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    !cfg!(all(unix, not(target_os = "macos")))
        || named("DISPLAY")
        || named("WAYLAND_DISPLAY")
        || named("WAYLAND_SOCKET")
}

/// A usage error on one line: clap's message without its usage text.
fn usage_error(error: &clap::Error) -> Error {
    let text = error.render().to_string();
    let message: Vec<&str> = text
        .lines()
        .map(str::trim)
        .take_while(|line| !line.starts_with("Usage:"))
        .filter(|line| !line.is_empty() && !line.starts_with("For more information"))
        .collect();
    let message = message.join(" ");
    let problem = message.strip_prefix("error: ").unwrap_or(&message);
    Error::usage("command line", problem, "see relit --help")
}
