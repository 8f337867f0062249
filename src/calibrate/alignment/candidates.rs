//! Candidate readings of a capture, one for each common mistake in its files.

use crate::capture::orientation::Orientation;
use crate::capture::reading::{Axes, Reading};

/// Factors between common length units and metres, and powers of ten.
const UNITS: [f64; 9] = [0.001, 0.01, 0.0254, 0.1, 0.3048, 10.0, 39.37, 100.0, 1000.0];
/// Size of the photographs relative to the size that their intrinsics are given for.
const SIZES: [f64; 6] = [0.125, 0.25, 0.5, 2.0, 4.0, 8.0];
/// Step between factors of scale and focal length: half the factor by which edges move out of their tolerance of a pixel.
const STEP: f64 = 1.05;
/// Steps in both directions, up to a factor of 2.5.
const STEPS: i32 = 19;

/// Readings that partly fit together with the given one: scale or focal length off by 5 and 10 %.
pub fn near() -> Vec<Reading> {
    let steps = [-2, -1, 1, 2].into_iter();
    steps.flat_map(|n| scaled(STEP.powi(n))).collect()
}

/// Readings that turn, mirror or permute something. Symmetric rooms partly fit several of them.
pub fn exchanged() -> Vec<Reading> {
    let given = Reading::default();
    let turned = [1, 2, 3].map(Orientation::turned);
    let mirrored = [0, 2].map(|n| Orientation::MIRRORED.then(Orientation::turned(n)));
    let mut readings: Vec<Reading> = (turned.into_iter().chain(mirrored))
        .map(|orientation| Reading {
            orientation,
            ..given
        })
        .collect();
    readings.extend([-1, 1].map(|shift| Reading { shift, ..given }));
    for axes in [Axes::OpenGl, Axes::OpenCv] {
        readings.extend([0, 1, 2, 3].map(|mesh_turns| Reading {
            axes,
            mesh_turns,
            ..given
        }));
    }
    readings.retain(|reading| !reading.is_default());
    readings
}

/// All candidate readings other than the given one.
pub fn all() -> Vec<Reading> {
    let steps = (1..=STEPS).flat_map(|n| [n, -n]);
    let mut readings: Vec<Reading> = steps.flat_map(|n| scaled(STEP.powi(n))).collect();
    readings.extend(UNITS.map(|unit| scaled(unit)[0]));
    readings.extend([0.1, 10.0].map(|focal| scaled(focal)[1]));
    readings.extend(SIZES.map(|lens_scale| Reading {
        lens_scale,
        ..Reading::default()
    }));
    readings.extend(exchanged());
    readings
}

/// The readings with the mesh's scale, and with the focal length, off by a factor.
fn scaled(factor: f64) -> [Reading; 2] {
    let mut readings = [Reading::default(); 2];
    readings[0].mesh_scale = factor;
    readings[1].focal = factor;
    readings
}

/// Readings between `reading` and its neighbouring factors; none if it changes neither scale nor focal length alone.
pub fn finer(reading: &Reading) -> Vec<Reading> {
    let which = match (reading.mesh_scale != 1.0, reading.focal != 1.0) {
        (true, false) => 0,
        (false, true) => 1,
        _ => return Vec::new(),
    };
    (-4..=4)
        .filter(|&n| n != 0)
        .map(|n| reading.then(&scaled(STEP.powf(f64::from(n) / 5.0))[which]))
        .collect()
}
