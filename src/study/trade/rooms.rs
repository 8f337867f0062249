//! Generated rooms for measuring trades; presets are chosen on them.

use crate::calibrate::problem::Problem;
use crate::error::Result;
use crate::room::generated::generate;
use crate::study::subject::Subject;
use crate::study::trade::metric::Metric;

/// Width and height of the photographs of generated rooms in pixels.
pub const SIZE: [u32; 2] = [96, 72];

/// Generated room `seed` with photographs, and a metric with its truth.
///
/// # Errors
/// Never for generated rooms.
pub fn problem(seed: u64, size: [u32; 2]) -> Result<(Problem, Metric)> {
    let (room, rendering) = generate(seed, size);
    let subject = Subject::of_room(&room, &rendering)?;
    Ok((subject.problem, subject.metric))
}
