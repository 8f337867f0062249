//! `relit trade --rooms N`: solves of generated rooms, family by family.

use crate::cli::interrupt::Interrupt;
use crate::error::{Error, Result};
use crate::inverse::settings::Preset;
use crate::room::generated::Family;
use crate::say;
use crate::study::families::{Plan, RoomEvent, Row, run};
use crate::study::trade::rooms::SIZE;
use std::path::Path;
use std::time::{Duration, Instant};

/// Selects all families.
pub const ALL: &str = "all";

/// Names of the families, and [`ALL`].
pub fn names() -> Vec<&'static str> {
    Family::NAMES.into_iter().chain([ALL]).collect()
}

/// Solves generated rooms of the named families with the given seeds. Starts no further room after `time`. Writes rooms.csv,
/// rooms.json and rooms.png, and prints a table.
///
/// # Errors
/// The results cannot be written, or a room could not be solved.
pub fn families(
    out: &Path,
    family: &str,
    preset: Preset,
    seeds: impl Iterator<Item = u64>,
    time: Option<Duration>,
    interrupt: &Interrupt,
) -> Result<()> {
    let plan = Plan {
        families: (Family::ALL.into_iter())
            .filter(|one| family == ALL || family == one.name())
            .collect(),
        seeds: seeds.collect(),
        size: SIZE,
        preset,
    };
    let started = Instant::now();
    let stopped = || interrupt.requested() || time.is_some_and(|time| started.elapsed() >= time);
    let mut failed: Option<Error> = None;
    let summary = run(out, &plan, &stopped, &mut |event| match event {
        RoomEvent::Begins(family, seed) => {
            say::note(format_args!("{} room {seed} …", family.name()))
        }
        RoomEvent::Solved(row) => say::note(line(row)),
        RoomEvent::Failed(error) => {
            say::note(error);
            failed.get_or_insert(error.clone());
        }
    })?;
    say::table(&summary.words());
    say::line(format_args!("results in {}", out.display()));
    failed.map_or(Ok(()), Err)
}

fn line(row: &Row) -> String {
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
