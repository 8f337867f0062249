//! How often it is noticed that a capture is read wrongly, and how often a sound one is taken for that.

use crate::calibrate::alignment::{Alignment, Verdict};
use crate::capture::Capture;
use crate::capture::orientation::Orientation;
use crate::capture::reading::{Axes, Reading};
use crate::capture::working::load_working;
use crate::error::Result;
use crate::scene::Scene;

/// A factor that is found is right within this part.
const TOLERANCE: f64 = 0.03;
/// Pixels of all photographs together.
const PIXELS: u64 = 4_000_000;

/// A mistake that people make, as the reading that makes it.
#[derive(Debug, Clone, Copy)]
pub struct Mistake {
    /// What is wrong.
    pub name: &'static str,
    /// The sound capture read so is wrong.
    pub reading: Reading,
}

/// How a capture fared.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// What was found.
    pub alignment: Alignment,
    /// Whether it was refused.
    pub detected: bool,
    /// Whether the reading that was offered undoes the mistake.
    pub right_remedy: bool,
}

/// Mistakes of geometry that all photographs share.
pub fn mistakes() -> Vec<Mistake> {
    let sound = Reading::default();
    let mistake = |name, reading| Mistake { name, reading };
    let scaled = |mesh_scale| Reading {
        mesh_scale,
        ..sound
    };
    let focal = |focal| Reading { focal, ..sound };
    let lies = |orientation| Reading {
        orientation,
        ..sound
    };
    vec![
        mistake("mesh 5 % too large", scaled(1.05)),
        mistake("mesh 1.5 times too large", scaled(1.5)),
        mistake("mesh in centimetres", scaled(100.0)),
        mistake("focal length × 1.2", focal(1.2)),
        mistake("focal length × 2", focal(2.0)),
        mistake("focal length × 0.5", focal(0.5)),
        mistake("focal length × 0.1", focal(0.1)),
        mistake(
            "lens of photographs twice as large",
            Reading {
                lens_scale: 2.0,
                ..sound
            },
        ),
        mistake("photographs upside down", lies(Orientation::turned(2))),
        mistake("photographs turned by 90°", lies(Orientation::turned(1))),
        mistake("photographs mirrored", lies(Orientation::MIRRORED)),
        mistake("photographs shifted by one", Reading { shift: 1, ..sound }),
        mistake(
            "poses with OpenCV's axes",
            Reading {
                axes: Axes::OpenCv,
                ..sound
            },
        ),
        mistake(
            "mesh with z up, poses with y up",
            Reading {
                mesh_turns: 1,
                ..sound
            },
        ),
    ]
}

/// Whether a capture is taken to be sound, or `mistake` in it is found.
///
/// # Errors
/// The capture cannot be read.
pub fn judge(capture: &Capture, mistake: Option<&Mistake>) -> Result<Outcome> {
    let made = mistake.map_or_else(Reading::default, |m| m.reading);
    let capture = capture.clone().read_as(&made);
    let working = load_working(&capture, PIXELS)?;
    let scene = Scene::new(&capture.at(&working))?;
    let alignment = Alignment::new(&scene, &working.photographs);
    let (detected, right_remedy) = match &alignment.verdict {
        Verdict::Wrong { reading, .. } => (true, undone(&made.then(reading))),
        _ => (false, false),
    };
    Ok(Outcome {
        alignment,
        detected,
        right_remedy,
    })
}

/// Whether a reading is that of the files, but for small factors.
fn undone(reading: &Reading) -> bool {
    let near = |factor: f64| factor.ln().abs() < TOLERANCE;
    let same = Reading {
        mesh_scale: 1.0,
        focal: 1.0,
        lens_scale: 1.0,
        ..*reading
    };
    // The same lens, however it is said.
    let focal = reading.focal * reading.lens_scale;
    same.is_default() && near(reading.mesh_scale) && near(focal) && near(reading.lens_scale)
}
