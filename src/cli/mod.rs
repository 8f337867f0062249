//! The command line: commands, progress, errors on one line.

mod arguments;
mod edit;
mod evaluate;
mod export;
mod families;
mod import;
mod insert;
mod interrupt;
mod object_values;
mod parameters;
mod photographs;
mod progress;
mod render;
mod report;
mod saved;
mod solve;
mod study;
mod trade;

use crate::error::{Error, Result};
use crate::inverse::settings::Settings;
use crate::session::command::{OpenOptions, Source};
use arguments::{Action, Arguments};
use clap::Parser;
use clap::error::ErrorKind;
use object_values::ObjectValues;

/// Opens the window on a source, read with some options, and returns when it is closed.
pub type Window = fn(Option<(Source, OpenOptions)>, Settings) -> Result<()>;

/// Runs the program with the process's arguments; the exit code: 0 done, 1 an error, 2 wrong usage.
///
/// `window` is absent from builds without one; every command but the plain `relit` does without.
pub fn run(window: Option<Window>) -> i32 {
    let outcome = match Arguments::try_parse() {
        Ok(arguments) => act(arguments, window),
        Err(error) => match error.kind() {
            ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
                // Help that cannot be printed has no reader.
                let _ = error.print();
                return 0;
            }
            _ => Err(misuse(&error)),
        },
    };
    match outcome {
        Ok(()) => 0,
        Err(error) => {
            eprintln!("error: {error}");
            error.exit_code()
        }
    }
}

fn act(arguments: Arguments, window: Option<Window>) -> Result<()> {
    match arguments.action {
        None => open(&arguments, window),
        Some(Action::Evaluate(evaluate)) => evaluate::evaluate(&evaluate),
        Some(Action::Render(render)) => render::render(&render),
        Some(Action::Insert(insert)) => insert::insert(&insert),
        Some(Action::Export(files)) => export::export(&files),
        Some(Action::Import(scan)) => import::import(&scan),
        Some(Action::Demo(demo)) => export::demo(&demo),
        Some(Action::Edit(edit)) => edit::edit(&edit),
        Some(Action::Trade(measured)) => trade::trade(&measured),
        Some(Action::Study(studied)) => study::study(&studied),
        Some(Action::Solve(capture)) => {
            let source = Source::Folder(capture.capture);
            let known = ObjectValues {
                emission: capture.known.known_emission,
                albedo: capture.known.known_albedo,
                ..ObjectValues::default()
            };
            solve::solve(&source, &capture.solve, &known)
        }
    }
}

/// `relit [CAPTURE]`: the window, or where none can be opened the same work headless.
fn open(arguments: &Arguments, window: Option<Window>) -> Result<()> {
    let source = arguments
        .capture
        .clone()
        .map_or(Source::BuiltInRoom, Source::Folder);
    let reason = match window {
        None => "this build has no window".to_owned(),
        Some(_) if !display() => "no display".to_owned(),
        Some(window) => {
            solve::use_threads(arguments.solve.threads)?;
            let settings = arguments.solve.settings();
            let opened = (source.clone(), arguments.solve.read.open(&settings));
            match window(Some(opened), settings) {
                Ok(()) => return Ok(()),
                Err(error) => error.to_string(),
            }
        }
    };
    eprintln!("relit: {reason}; solving without a window");
    solve::solve(&source, &arguments.solve, &ObjectValues::default())
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
