//! Solves of generated rooms, family by family, compared with what is true: what holds over rooms and not of one capture alone.
//!
//! Each room is a row of rooms.csv, written as soon as it is solved; rows that are there are not solved again. From all rows of one
//! program, preset and size come rooms.json and rooms.png.

mod composite;
mod lamps;
mod plot;
mod row;
mod score;
mod segments;
mod summary;

pub use composite::{CompositeRow, Decision, composite, table};
pub use plot::plot;
pub use row::{Row, Rows};
pub use score::measure;
pub use summary::{Quantiles, Summary, summarize};

use crate::error::{Error, Result};
use crate::inverse::settings::Preset;
use crate::room::generated::Family;
use std::path::Path;

/// Which rooms are solved, and how.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The families, one after the other.
    pub families: Vec<Family>,
    /// The seeds of the rooms of each, which are those of the solves too.
    pub seeds: Vec<u64>,
    /// Width and height of the photographs in pixels.
    pub size: [u32; 2],
    /// The preset of every solve.
    pub preset: Preset,
}

/// What is told while rooms are solved.
#[derive(Debug)]
pub enum Heard<'a> {
    /// A room is drawn and solved.
    Begins(Family, u64),
    /// It has been solved.
    Solved(&'a Row),
    /// It could not be.
    Failed(&'a Error),
}

/// Solves what rooms.csv in `folder` lacks, until `stopped`; then writes rooms.json and rooms.png of all its rows that belong to the
/// plan's program, preset and size.
///
/// # Errors
/// A file cannot be read or written, or rooms.csv is no such table. Rooms that could not be solved are told of and left out.
pub fn run(
    folder: &Path,
    plan: &Plan,
    stopped: &dyn Fn() -> bool,
    tell: &mut dyn FnMut(Heard),
) -> Result<Summary> {
    let mut rows = Rows::open(folder)?;
    for &family in &plan.families {
        for &seed in &plan.seeds {
            if stopped() || rows.holds(plan, family, seed) {
                continue;
            }
            tell(Heard::Begins(family, seed));
            match measure(family, seed, plan) {
                Ok(row) => {
                    tell(Heard::Solved(&row));
                    rows.append(row)?;
                }
                Err(error) => tell(Heard::Failed(&error)),
            }
        }
    }
    let summary = summarize(plan, rows.of(plan));
    summary.write(folder)?;
    plot(&summary, rows.of(plan)).write(&folder.join("rooms.png"))?;
    Ok(summary)
}
