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
    [-2, -1, 1, 2].into_iter().flat_map(factor).collect()
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
        for mesh_turns in 0..4 {
            readings.push(Reading {
                axes,
                mesh_turns,
                ..given
            });
        }
    }
    readings.retain(|reading| !reading.is_default());
    readings
}

/// All candidate readings other than the given one.
pub fn all() -> Vec<Reading> {
    let given = Reading::default();
    let mut readings: Vec<Reading> = (1..=STEPS).flat_map(|n| [n, -n]).flat_map(factor).collect();
    readings.extend(UNITS.map(|mesh_scale| Reading {
        mesh_scale,
        ..given
    }));
    readings.extend([0.1, 10.0].map(|focal| Reading { focal, ..given }));
    readings.extend(SIZES.map(|lens_scale| Reading {
        lens_scale,
        ..given
    }));
    readings.extend(exchanged());
    readings.retain(|reading| !reading.is_default());
    readings
}

/// The readings with the mesh's scale, or the focal length, off by `steps` steps.
fn factor(steps: i32) -> [Reading; 2] {
    let factor = STEP.powi(steps);
    let given = Reading::default();
    [
        Reading {
            mesh_scale: factor,
            ..given
        },
        Reading {
            focal: factor,
            ..given
        },
    ]
}

/// Readings between `reading` and its neighbouring factors; none if it changes neither scale nor focal length alone.
pub fn finer(reading: &Reading) -> Vec<Reading> {
    let steps = (-4..=4).filter(|&n| n != 0);
    let factors = steps.map(|n| STEP.powf(f64::from(n) / 5.0));
    match (reading.mesh_scale != 1.0, reading.focal != 1.0) {
        (true, false) => factors
            .map(|f| Reading {
                mesh_scale: reading.mesh_scale * f,
                ..*reading
            })
            .collect(),
        (false, true) => factors
            .map(|f| Reading {
                focal: reading.focal * f,
                ..*reading
            })
            .collect(),
        _ => Vec::new(),
    }
}
