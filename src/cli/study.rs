//! `relit study`: the experiments of the paper.

use crate::cli::numbers::{from_one, seeds, threads};
use crate::cli::options::{ReadOptions, Replace, use_threads};
use crate::cli::trade::time;
use crate::error::{Error, Result};
use crate::inverse::settings::{Preset, Settings};
use crate::room::generated::Family;
use crate::say;
use crate::session::command::Source;
use crate::session::open::open;
use crate::study::experiments::{Bench, STUDIES, Study};
use crate::study::families::{CompositeRow, Decision, Plan, Rows, composite};
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser};
use std::path::PathBuf;
use std::time::Duration;

const ALL: &str = "all";
/// Width and height of the photographs that a chair is inserted into; of those of `relit trade` it may cover 35 pixels only.
const SIZE: [u32; 2] = [240, 180];
/// Default number of seeds with `--quick`.
const QUICK_SEEDS: u64 = 2;

#[derive(Debug, Args)]
pub struct StudyArguments {
    /// The study
    #[arg(value_name = "NAME", value_parser = names())]
    name: String,
    /// Folder to write NAME.csv, NAME.png and NAME.md into
    #[arg(long, value_name = "DIR", default_value = "relit-out/studies")]
    out: PathBuf,
    /// Time for all solves of a study together; making scenes and measuring comes on top
    #[arg(long, value_name = "TIME", default_value = "5m", value_parser = time)]
    time: Duration,
    /// Seeds that each solve is repeated with: 1, 2, … [default: 5, of table1 10; quick: 2]
    #[arg(long, value_name = "N", value_parser = seeds)]
    seeds: Option<u64>,
    /// Quick trial of some seconds: fewer values, smaller scenes, shorter solves
    #[arg(long)]
    quick: bool,
    /// A capture to run on instead of the study's own rooms: batch, textures and readings use its photographs, the
    /// others its twin: a room with its mesh, its views, and the colours and lamps found in it, whose truth is known
    #[arg(long, value_name = "CAPTURE")]
    capture: Option<PathBuf>,
    /// Run `insertion` in N generated rooms of a family instead: a chair inserted into two photographs is compared
    /// with the chair truly in the room
    #[arg(long, value_name = "N", requires = "family", conflicts_with = "capture", value_parser = from_one::<u32>)]
    rooms: Option<u32>,
    /// The family of the generated rooms
    #[arg(long, value_name = "NAME", requires = "rooms", value_parser = PossibleValuesParser::new(Family::NAMES))]
    family: Option<String>,
    /// The preset that generated rooms are solved with
    #[arg(long, value_name = "PRESET", requires = "rooms", default_value = "balanced", value_parser = PossibleValuesParser::new(Preset::WORDS))]
    preset: String,
    /// Number of threads [default: one per core]
    #[arg(long, value_name = "N", value_parser = threads)]
    threads: Option<u16>,
    #[command(flatten)]
    replace: Replace,
    #[command(flatten)]
    read: ReadOptions,
}

fn names() -> PossibleValuesParser {
    let named = |study: &Study| PossibleValue::new(study.name).help(study.question);
    let studies = STUDIES.iter().map(named);
    PossibleValuesParser::new(studies.chain([PossibleValue::new(ALL).help("All of them")]))
}

/// Runs the studies and writes the findings of each as soon as it is done.
pub fn study(arguments: &StudyArguments) -> Result<()> {
    arguments.replace.apply();
    use_threads(arguments.threads)?;
    if let Some((rooms, family)) = arguments.rooms.zip(arguments.family.as_deref()) {
        return insertions(arguments, rooms, family);
    }
    let is_wanted = |study: &&Study| arguments.name == ALL || study.name == arguments.name;
    let options = arguments.read.open(&Settings::default());
    let source = arguments.capture.clone().map(Source::Folder);
    let subject = source.map(|source| open(&source, &options)?.aligned()?.subject());
    let subject = subject.transpose()?;
    let quick = arguments.quick;
    for study in STUDIES.iter().filter(is_wanted) {
        let seeds = if quick { QUICK_SEEDS } else { study.seeds };
        let bench = Bench {
            quick,
            time: arguments.time,
            seeds: arguments.seeds.unwrap_or(seeds),
            subject: subject.as_ref(),
            say: &|what| say::note(format_args!("{}: {what} …", study.name)),
            show: &|_| {},
            stopped: &|| false,
        };
        let findings = study.run(&bench)?;
        for path in findings.write(study, &arguments.out)? {
            say::line(path.display());
        }
        for sentence in &findings.seen {
            say::line(sentence);
        }
    }
    Ok(())
}

/// Runs the study `insertion` over generated rooms that insertion-FAMILY.csv lacks, and prints the decision over all rooms.
fn insertions(arguments: &StudyArguments, rooms: u32, family: &str) -> Result<()> {
    let mut presets = Preset::ALL.iter().copied();
    let preset = presets.find(|preset| preset.word() == arguments.preset);
    let known = Family::of_name(family).zip(preset);
    let Some((family, preset)) = known.filter(|_| arguments.name == "insertion") else {
        let problem = format!("`{}` is not run over generated rooms", arguments.name);
        return Err(Error::usage("--rooms", problem, "name the study insertion"));
    };
    let plan = Plan {
        families: vec![family],
        seeds: (1..=u64::from(rooms)).collect(),
        size: SIZE,
        preset,
    };
    let file = (arguments.out).join(format!("insertion-{}.csv", family.name()));
    let mut rows: Rows<CompositeRow> = Rows::open(file.clone())?;
    for &seed in &plan.seeds {
        if let Some(row) = rows.find(&plan, family, seed) {
            say::note(row.words());
            continue;
        }
        say::note(format_args!("{} room {seed} …", family.name()));
        match composite(family, seed, &plan)? {
            Some((row, pictures)) => {
                say::note(row.words());
                let name = format!("insertion-{}-{seed}.png", family.name());
                pictures.write(&arguments.out.join(name))?;
                rows.append(row)?;
            }
            None => say::note("  no free place on its floor that photographs see"),
        }
    }
    let solved: Vec<&CompositeRow> = (plan.seeds.iter())
        .filter_map(|&seed| rows.find(&plan, family, seed))
        .collect();
    say::line(Decision::of(&solved).words());
    say::line(file.display());
    Ok(())
}
