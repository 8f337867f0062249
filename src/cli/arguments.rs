//! The commands and their options.

use crate::cli::edit::EditArguments;
use crate::cli::evaluate::EvaluateArguments;
use crate::cli::export::{DemoArguments, ExportArguments};
use crate::cli::import::ImportArguments;
use crate::cli::insert::InsertArguments;
use crate::cli::interrupt::EXIT_CODES;
use crate::cli::object_values::named_color;
use crate::cli::options::SolveOptions;
use crate::cli::render::RenderArguments;
use crate::cli::study::StudyArguments;
use crate::cli::trade::TradeArguments;
use clap::{Arg, Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use glam::Vec3;
use std::ffi::OsString;
use std::path::PathBuf;

/// Recovers the lights and materials of a scanned room from photographs, and puts new objects into them.
#[derive(Debug, Parser)]
#[command(
    version,
    args_conflicts_with_subcommands = true,
    disable_help_subcommand = true,
    after_help = EXIT_CODES
)]
pub struct Arguments {
    /// What to open in the window: a capture, a scan of another program, or results to go on from; the built-in room
    /// if none is named
    pub capture: Option<PathBuf>,
    #[command(flatten)]
    pub solve: SolveOptions,
    #[command(subcommand)]
    pub action: Option<Action>,
}

impl Arguments {
    /// Parses a command line; the first word is the program's name.
    pub fn from_words<W: Into<OsString> + Clone>(
        words: impl IntoIterator<Item = W>,
    ) -> std::result::Result<Self, clap::Error> {
        // A negative number is parsed as the value of the option before it, so that the error names that option.
        let negative_values = |argument: Arg| match argument.is_positional() {
            true => argument,
            false => {
                let values = argument.get_num_args();
                let takes_value = argument.get_action().takes_values()
                    && values.is_none_or(|count| count.max_values() > 0);
                argument.allow_negative_numbers(takes_value)
            }
        };
        let command = Self::command().mut_args(negative_values);
        let command = command.mut_subcommands(|command| command.mut_args(negative_values));
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
    /// Insert objects into photographs
    #[command(after_help = EXIT_CODES)]
    Insert(InsertArguments),
    /// Switch lamps, recolour walls, and render the result
    #[command(after_help = EXIT_CODES)]
    Edit(EditArguments),
    /// Write the scene or its light for another program
    Export(ExportArguments),
    /// Import a scan of another program as a capture
    Import(ImportArguments),
    /// Write the built-in room, or a generated one, as a capture with its truth
    Demo(DemoArguments),
    /// Measure the error over time of presets and settings
    #[command(after_help = EXIT_CODES)]
    Trade(TradeArguments),
    /// Rerun experiments of the paper
    Study(StudyArguments),
}

#[derive(Debug, Args)]
pub struct SolveArguments {
    /// A capture, a scan of another program (imported first, into relit-out/<scan>/capture), or results to go on from
    pub capture: PathBuf,
    #[command(flatten)]
    pub solve: SolveOptions,
    /// Radiance that an object is known to emit; held while the rest is solved
    #[arg(long, value_name = "NAME=R,G,B", value_parser = named_color)]
    pub known_emission: Vec<(String, Vec3)>,
    /// Diffuse reflectance, 0 to 1, that an object is known to have; held while the rest is solved
    #[arg(long, value_name = "NAME=R,G,B", value_parser = named_color)]
    pub known_albedo: Vec<(String, Vec3)>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The error message for an option's value; empty if it is accepted.
    fn message(command: &str, option: &str, value: &str) -> String {
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
                    let message = message(command.get_name(), &option, value);
                    let vague = [
                        "unexpected argument",
                        "invalid digit",
                        "invalid float",
                        "is not in",
                    ];
                    let is_vague = vague.iter().any(|words| message.contains(words));
                    assert!(!is_vague, "{message}");
                    let wanted = [&option, &format!("'{value}'"), "wanted"];
                    numbers += u32::from(wanted.iter().all(|words| message.contains(words)));
                }
            }
        }
        assert!(numbers > 60, "{numbers}");
    }
}
