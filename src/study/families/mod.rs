//! Solves of generated rooms by family, compared with their truth: what holds over many rooms instead of one capture.
//!
//! Each room is a row of a table, which is written as soon as it is solved; existing rows are not solved again.
//! rooms.json and rooms.png summarize all rows of rooms.csv of one program version, preset and size.

mod composite;
mod row;
mod score;
mod segments;
mod summary;

pub use composite::{CompositeRow, Decision, composite};
pub use row::{RoomRow, Row, Rows, Solve};
pub use score::measure;
pub use summary::{Quantiles, Summary, plot, summarize};

use crate::error::{Error, Result};
use crate::inverse::settings::Preset;
use crate::room::generated::Family;
use std::path::Path;

/// Which rooms to solve, and how.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The families, one after the other.
    pub families: Vec<Family>,
    /// The seeds of each family's rooms, and of their solves.
    pub seeds: Vec<u64>,
    /// Width and height of the photographs in pixels.
    pub size: [u32; 2],
    /// The preset of every solve.
    pub preset: Preset,
}

impl Plan {
    /// How rooms are solved by this version of the program.
    fn solve(&self) -> Solve<'_> {
        (env!("CARGO_PKG_VERSION"), self.preset.word(), self.size)
    }
}

/// Progress of [`run`].
#[derive(Debug)]
pub enum RoomEvent<'a> {
    /// A room is generated and solved.
    Begins(Family, u64),
    /// A room has been solved.
    Solved(&'a Row),
    /// A room could not be solved.
    Failed(&'a Error),
}

/// Solves rooms that rooms.csv in `folder` lacks, until `stopped`; then writes rooms.json and rooms.png over all rows of the plan.
///
/// # Errors
/// A file cannot be read or written, or rooms.csv is another table. Rooms that cannot be solved are reported and left out.
pub fn run(
    folder: &Path,
    plan: &Plan,
    stopped: &dyn Fn() -> bool,
    report: &mut dyn FnMut(RoomEvent),
) -> Result<Summary> {
    let mut rows: Rows<Row> = Rows::open(folder.join("rooms.csv"))?;
    for &family in &plan.families {
        for &seed in &plan.seeds {
            if stopped() || rows.find(plan, family, seed).is_some() {
                continue;
            }
            report(RoomEvent::Begins(family, seed));
            match measure(family, seed, plan) {
                Ok(row) => {
                    report(RoomEvent::Solved(&row));
                    rows.append(row)?;
                }
                Err(error) => report(RoomEvent::Failed(&error)),
            }
        }
    }
    let summary = summarize(plan, rows.of(plan));
    summary.write(folder)?;
    plot(&summary, rows.of(plan)).write(&folder.join("rooms.png"))?;
    Ok(summary)
}
