//! Which rooms are solved, and how.

use crate::inverse::settings::Preset;
use crate::room::generated::Family;

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
