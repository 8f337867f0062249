//! The manual's chapter on the command line, made from the commands themselves.

use clap::builder::PossibleValue;
use clap::{Arg, ArgAction, Command};
use relit::cli;
use relit::inverse::settings::{PARAMETERS, Parameter};
use std::collections::BTreeSet;

/// Beginning of the chapter: what holds for all commands.
const INTRODUCTION: &str = "\
# Command line

<!-- Made from the program by `RELIT_WRITE_DOCS=1 cargo test --test docs`; changes by hand are lost. -->

Nearly all that [the window](window.md) does can be done by commands too. Joining and cutting objects are the window's
alone; the choices of an import are the command line's alone.

* `relit COMMAND --help` prints what stands below.
* What was found and written goes to standard output. Progress, warnings and errors go to standard error.
* An error is one line: where, what is wrong, what to do. The exit code is 0 where all went well, 1 after an error, and
  2 where the command was used wrongly.
* Times are written as `90`, `90s`, `5m` or `1h`.
* Photographs are counted from 0, in the order of `transforms.json`.
* Colours are linear and in the order red, green, blue.

";

/// Help heading of the parameters of a solve.
const PARAMETERS_HEADING: &str = "Parameters of the solve";

/// Example command lines; the first argument of each is its command.
const EXAMPLES: &[&str] = &[
    "relit solve room --out results",
    "relit solve room --out results --preset reference --time 5m",
    "relit solve room --out results --resume",
    "relit solve room --out results --known-albedo floor=0.42,0.27,0.15",
    "relit evaluate results --truth room",
    "relit render results --frame 0 --spp 256 --denoise --out room.png",
    "relit render results --frame 0 --layers --out lamps.exr",
    "relit insert results --object chair.glb --frame 0 --at 0.4,0,1.2 --rotate 30 --denoise --out chair",
    "relit insert results --object chair.glb --at 0.4,0,1.2 --object vase.obj --scale 0.01 --at 0.4,0.5,1.2 --frame all --out both",
    "relit edit results --emission floor-lamp=0,0,0 --albedo west-wall=0.2,0.3,0.6 --photographs --out blue",
    "relit export results --format glb --out room.glb",
    "relit export results --format probe --at 0,1.2,0 --out light.hdr",
    "relit import scan --out room",
    "relit import project --format colmap --mesh meshed-poisson.ply --out room",
    "relit demo --out room",
    "relit trade room --time 5m --out trade",
    "relit trade --rooms 8 --time 16m --out trade",
    "relit study table1 --quick --out studies",
];

/// The chapter as Markdown: introduction, every command with its arguments and options, and the parameters of a solve.
pub fn markdown() -> String {
    let mut root = cli::command();
    root.build();
    let mut text = INTRODUCTION.to_owned();
    text += "| command | what it does |\n| --- | --- |\n";
    text += "| [`relit [CAPTURE]`](#relit) | Open the window; without a display, solve the same capture headless |\n";
    for command in root.get_subcommands() {
        let name = command.get_name();
        text += &format!("| [`relit {name}`](#relit-{name}) | {} |\n", about(command));
    }
    if let Some(note) = root.get_after_help() {
        text += &format!("\n{note}.\n");
    }
    text += &section("relit", &root);
    for command in root.get_subcommands() {
        text += &section(&format!("relit {}", command.get_name()), command);
    }
    text += &parameters(&root);
    text
}

/// One command: what it does, usage, examples, arguments, options.
fn section(title: &str, command: &Command) -> String {
    let usage = command.clone().render_usage().to_string();
    let usage: Vec<&str> = usage.lines().map(str::trim).collect();
    let usage = usage.join("\n").replacen("Usage: ", "", 1);
    let about = about(command);
    let mut text = format!("\n## {title}\n\n{about}.\n\n```text\n{usage}\n```\n");
    let begins = |line: &&&str| line.strip_prefix(title).is_some_and(|r| r.starts_with(' '));
    let examples: Vec<&str> = match command.has_subcommands() {
        true => vec!["relit", "relit room"],
        false => EXAMPLES.iter().filter(begins).copied().collect(),
    };
    if !examples.is_empty() {
        text += &format!("\n```sh\n{}\n```\n", examples.join("\n"));
    }
    let arguments: Vec<&Arg> = command.get_arguments().filter(|a| is_listed(a)).collect();
    let (positional, options): (Vec<&Arg>, _) = arguments.iter().partition(|a| a.is_positional());
    text += &table("argument", &positional);
    let headings: BTreeSet<Option<&str>> = options.iter().map(|a| a.get_help_heading()).collect();
    for heading in headings {
        if heading == Some(PARAMETERS_HEADING) {
            text += "\nAnd all [parameters of the solve](#parameters-of-the-solve).\n";
            continue;
        }
        let under: Vec<&Arg> = (options.iter().copied())
            .filter(|a: &&Arg| a.get_help_heading() == heading)
            .collect();
        if let Some(heading) = heading {
            text += &format!("\n{heading}:\n");
        }
        text += &table("option", &under);
    }
    for argument in arguments {
        text += &values(argument);
    }
    text
}

/// Whether an argument gets a row: help and version, which are the same everywhere, do not.
fn is_listed(argument: &Arg) -> bool {
    !argument.is_hide_set() && !["help", "version"].contains(&argument.get_id().as_str())
}

/// What a command does, without the full stop.
fn about(command: &Command) -> String {
    let about = command.get_about();
    about.map_or_else(String::new, ToString::to_string)
}

/// One row per argument; empty without arguments.
fn table(title: &str, arguments: &[&Arg]) -> String {
    if arguments.is_empty() {
        return String::new();
    }
    let mut text = format!("\n| {title} | meaning | default |\n| --- | --- | --- |\n");
    for argument in arguments {
        let (mut meaning, default) = meaning(argument);
        let named: Vec<String> = (argument.get_possible_values().iter())
            .filter(|value| value.get_help().is_none())
            .map(|value| format!("`{}`", value.get_name()))
            .collect();
        if takes_value(argument) && !named.is_empty() {
            meaning += &format!(". One of {}", named.join(", "));
        }
        let repeats = matches!(argument.get_action(), ArgAction::Append);
        if repeats && argument.get_help_heading().is_none() {
            meaning += ". May repeat";
        }
        text += &row(&[&format!("`{}`", syntax(argument)), &meaning, &default]);
    }
    text
}

/// A table of an argument's possible values; empty unless they have help texts.
fn values(argument: &Arg) -> String {
    let explained = |value: &PossibleValue| {
        let help = value.get_help()?.to_string();
        Some(row(&[&format!("`{}`", value.get_name()), &help]))
    };
    let values = argument.get_possible_values();
    let rows: String = values.iter().filter_map(explained).collect();
    if rows.is_empty() || !takes_value(argument) {
        return String::new();
    }
    let syntax = syntax(argument);
    format!("\nValues of `{syntax}`:\n\n| value | meaning |\n| --- | --- |\n{rows}")
}

/// The parameters of a solve, listed once for all commands that take them.
fn parameters(root: &Command) -> String {
    let mut text = "\n## Parameters of the solve\n\n\
        `relit` and `relit solve` take them all. The pane *Settings* of the window shows the same table. Those that say *at once* \
        also change a solve that runs in the window; the others take effect at the next reset.\n\n\
        | option | meaning | default | allowed | in the window |\n| --- | --- | --- | --- | --- |\n"
        .to_owned();
    let arguments = root.get_arguments();
    for argument in arguments.filter(|a| a.get_help_heading() == Some(PARAMETERS_HEADING)) {
        let named = |p: &&Parameter| p.name == argument.get_id().as_str();
        let Some(parameter) = PARAMETERS.iter().find(named) else {
            continue;
        };
        let (meaning, default) = meaning(argument);
        let unit = match parameter.unit {
            "" => String::new(),
            unit => format!(" ({unit})"),
        };
        let allowed = parameter.allowed() + &unit;
        let when = if parameter.live { "at once" } else { "" };
        let option = format!("`{}`", syntax(argument));
        text += &row(&[&option, &meaning, &default, &allowed, when]);
    }
    text
}

/// The help text without its "[default: …]", and the default.
fn meaning(argument: &Arg) -> (String, String) {
    let help = argument.get_help();
    let help = help.map_or_else(String::new, ToString::to_string);
    let stated = help.strip_suffix(']');
    let stated = stated.and_then(|rest| rest.rsplit_once(" [default: "));
    if let Some((meaning, default)) = stated {
        return (meaning.to_owned(), default.to_owned());
    }
    let values = argument.get_default_values().iter();
    let default = match takes_value(argument) {
        true => values.map(|v| v.to_string_lossy().into_owned()).collect(),
        false => Vec::new(),
    };
    let default = match (argument.is_required_set(), default.join(", ")) {
        (true, _) => "required".to_owned(),
        (false, default) => default,
    };
    (help, default)
}

/// How an argument is typed.
fn syntax(argument: &Arg) -> String {
    let names = argument.get_value_names().unwrap_or_default();
    let value = names.first().map_or("", |name| name.as_str());
    match argument.get_long() {
        None if argument.is_required_set() => value.to_owned(),
        None => format!("[{value}]"),
        Some(long) if takes_value(argument) => format!("--{long} {value}"),
        Some(long) => format!("--{long}"),
    }
}

fn takes_value(argument: &Arg) -> bool {
    let number = argument.get_num_args();
    number.map_or(argument.get_action().takes_values(), |n| n.takes_values())
}

/// A row of a Markdown table, with `|` and `<` escaped.
fn row(cells: &[&str]) -> String {
    let cells: Vec<String> = cells.iter().map(|cell| escaped(cell)).collect();
    format!("| {} |\n", cells.join(" | "))
}

fn escaped(cell: &str) -> String {
    let bars = cell.replace('|', "\\|");
    match cell.starts_with('`') {
        true => bars,
        false => bars.replace('<', "\\<"),
    }
}
