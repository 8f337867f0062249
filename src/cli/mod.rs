//! The command line: commands, progress, errors on one line.

mod arguments;
mod edit;
mod evaluate;
mod export;
mod families;
mod import;
mod insert;
mod interrupt;
mod numbers;
mod object_values;
mod parameters;
mod photographs;
mod progress;
pub mod reference;
mod render;
mod report;
mod saved;
mod solve;
mod study;
mod trade;

use crate::error::{Error, Result};
use crate::inverse::settings::Settings;
use crate::say;
use crate::session::command::{Source, Start};
use crate::session::given::Given;
use crate::session::save;
use arguments::{Action, Arguments, SolveOptions};
use clap::CommandFactory;
use clap::error::ErrorKind;
use object_values::ObjectValues;
use std::path::Path;

/// Letters that may be wrong, missing or swapped in a command that is still known for what it was meant as.
const MAX_SLIPS: usize = 2;

/// Opens the window and returns when it is closed.
pub type Window = fn(Option<Start>, Settings) -> Result<()>;

/// Runs the program with the process's arguments; the exit code: 0 done, 1 an error, 2 wrong usage, 128 and a signal's number
/// where that ended the work.
///
/// `window` is absent from builds without one; every command but the plain `relit` does without.
pub fn run(window: Option<Window>) -> i32 {
    let outcome = match Arguments::from_words(std::env::args_os()) {
        Ok(arguments) => act(arguments, window),
        Err(error) => match error.kind() {
            ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
                // Help that cannot be printed has no reader.
                let _ = error.print();
                return 0;
            }
            _ => Err(mistyped().unwrap_or_else(|| misuse(&error))),
        },
    };
    match outcome {
        Ok(code) => code,
        Err(error) => {
            say::aside(format_args!("error: {error}"));
            error.exit_code()
        }
    }
}

/// The exit code: 0, or what tells how the work was interrupted.
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
                emission: capture.known.known_emission,
                albedo: capture.known.known_albedo,
                ..ObjectValues::default()
            };
            let mut options = capture.solve;
            let source = take(&capture.capture, &mut options)?;
            solve::solve(&source, &options, &known)
        }
    }
}

/// The error for a first word that was meant as a command, where what clap makes of the line is a riddle.
fn mistyped() -> Option<Error> {
    let first = std::env::args_os().nth(1)?;
    let first = first.to_str().filter(|word| !word.starts_with('-'))?;
    let is_command = |name: &str| Arguments::command().find_subcommand(name).is_some();
    if is_command(first) || Path::new(first).exists() {
        return None;
    }
    // Behind a capture's path nothing but options may follow.
    let second = std::env::args_os().nth(2);
    let extra = second.is_some_and(|word| !word.to_string_lossy().starts_with('-'));
    command_meant(first).or_else(|| extra.then(|| unknown_command(first, "see relit --help")))
}

/// The error for a word that is nearly a command's name.
fn command_meant(word: &str) -> Option<Error> {
    let command = Arguments::command();
    let names = command.get_subcommands().map(|known| known.get_name());
    let (distance, name) = names
        .map(|name| (strsim::osa_distance(word, name), name))
        .min()?;
    // Two slips of the hand, but not half of the word.
    let near = distance <= MAX_SLIPS && 2 * distance < name.len();
    near.then(|| unknown_command(word, &format!("did you mean '{name}'?")))
}

fn unknown_command(word: &str, remedy: &str) -> Error {
    let problem = format!("unknown command '{word}', and there is no such folder");
    Error::usage("command line", problem, remedy)
}

/// `relit [CAPTURE]`: the window, or where none can be opened the same work headless.
fn open(arguments: Arguments, window: Option<Window>) -> Result<i32> {
    if let Some(folder) = arguments.capture.as_ref().filter(|folder| !folder.exists())
        && let Some(error) = folder.to_str().and_then(command_meant)
    {
        return Err(error);
    }
    let mut options = arguments.solve;
    let source = match &arguments.capture {
        None => Source::BuiltInRoom,
        Some(path) => take(path, &mut options)?,
    };
    let reason = match window {
        None => "this build has no window".to_owned(),
        Some(_) if !display() => "no display".to_owned(),
        Some(window) => {
            solve::use_threads(options.threads)?;
            let settings = options.settings();
            let start = match options.out.clone().filter(|_| options.resume) {
                Some(results) => Start::Results(results),
                None => Start::Capture(source.clone(), options.read.open(&settings)),
            };
            match window(Some(start), settings) {
                Ok(()) => return Ok(0),
                Err(error) => error.to_string(),
            }
        }
    };
    say::aside(format_args!("relit: {reason}; solving without a window"));
    solve::solve(&source, &options, &ObjectValues::default())
}

/// The source of whatever a person names. A scan is imported first; results are gone on from, which the options then say.
fn take(path: &Path, options: &mut SolveOptions) -> Result<Source> {
    match Given::at(path)? {
        Given::Capture(folder) => Ok(Source::Folder(folder)),
        Given::Results(folder) => {
            let source = save::load_checkpoint(&folder)?.source;
            say::aside(format_args!("going on from {}", folder.display()));
            options.out.get_or_insert(folder);
            options.resume = true;
            Ok(source)
        }
        Given::Scan(scan) => import::beside_results(&scan).map(Source::Folder),
    }
}

/// Whether there may be a display to open a window on.
fn display() -> bool {
    let named = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    !cfg!(all(unix, not(target_os = "macos")))
        || named("DISPLAY")
        || named("WAYLAND_DISPLAY")
        || named("WAYLAND_SOCKET")
}

/// A usage error on one line: what clap says before its usage text.
fn misuse(error: &clap::Error) -> Error {
    let text = error.render().to_string();
    let said: Vec<&str> = text
        .lines()
        .map(str::trim)
        .take_while(|line| !line.starts_with("Usage:"))
        .filter(|line| !line.is_empty() && !line.starts_with("For more information"))
        .collect();
    let said = said.join(" ");
    Error::usage(
        "command line",
        said.strip_prefix("error: ").unwrap_or(&said),
        "see relit --help",
    )
}
