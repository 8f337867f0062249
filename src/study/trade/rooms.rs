//! Generated rooms for measuring trades; presets are chosen on them.

use crate::calibrate::problem::Problem;
use crate::capture::Capture;
use crate::capture::photograph::Photograph;
use crate::capture::truth::Truth;
use crate::error::Result;
use crate::room::Room;
use crate::room::generated::generate;
use crate::room::photographs::{self, Rendering};
use crate::scene::Scene;
use crate::study::evaluate::Reference;
use crate::study::trade::metric::Metric;
use std::sync::Arc;

/// Width and height of the photographs of generated rooms in pixels.
pub const SIZE: [u32; 2] = [96, 72];

/// Generated room `seed` with photographs, and a metric with its truth.
///
/// # Errors
/// Never for generated rooms.
pub fn problem(seed: u64, size: [u32; 2]) -> Result<(Problem, Metric)> {
    let (room, rendering) = generate(seed, size);
    let (problem, reference) = photographed(&room, &rendering)?;
    Ok((problem, Metric::Truth(Box::new(reference))))
}

/// A room with rendered photographs, and its truth.
///
/// # Errors
/// The room's mesh is empty.
pub fn photographed(room: &Room, rendering: &Rendering) -> Result<(Problem, Reference)> {
    let photographs = photographs::render(room, rendering)?;
    let (_, problem, reference) = with_photographs(room, photographs)?;
    Ok((problem, reference))
}

/// A room with given photographs, one a view and all of one size: as a capture, as a problem, and its truth.
///
/// # Errors
/// The room's mesh is empty, or there is no photograph.
pub fn with_photographs(
    room: &Room,
    photographs: Vec<Photograph>,
) -> Result<(Capture, Problem, Reference)> {
    let size = photographs.first().map_or([0; 2], |p| [p.width, p.height]);
    let capture = room.capture_of(photographs, size);
    let photographs: Vec<_> = capture
        .frames
        .iter()
        .map(|frame| frame.load())
        .collect::<Result<_>>()?;
    let scene = Scene::new(&capture)?;
    let truth: Truth = room.truth(size)?;
    let reference = Reference::new(truth, &capture, &scene, &photographs);
    let problem = Problem {
        scene: Arc::new(scene),
        photographs,
    };
    Ok((capture, problem, reference))
}
