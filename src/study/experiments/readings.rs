//! Study: how often a wrong reading of a capture is detected, and how often a correct one is refused.

use crate::calibrate::alignment::{Alignment, Decision};
use crate::calibrate::photographs::leave_out;
use crate::capture::Capture;
use crate::capture::orientation::Orientation;
use crate::capture::reading::{Axes, Reading};
use crate::capture::working::load_working;
use crate::error::Result;
use crate::export::table::Table;
use crate::room;
use crate::room::generated::Family;
use crate::scene::Scene;
use crate::study::experiments::study::{Bench, Findings, Study, Summary};
use crate::study::trade::rooms;

/// The study.
pub const STUDY: Study = Study {
    name: "readings",
    question: "Captures whose files are read wrongly (axes, unit, focal length, order, orientation) are refused with the reading \
        that mends them. How often, and how often is a sound capture refused?",
    seeds: 5,
    run,
};

/// Relative tolerance of a factor that is found.
const TOLERANCE: f64 = 0.03;
/// Pixel budget of all photographs together.
const PIXELS: u64 = 4_000_000;
/// Most captures that mistakes are tested in.
const MAX_CAPTURES: usize = 6;

/// A common mistake.
#[derive(Debug, Clone, Copy)]
pub struct Mistake {
    /// Description.
    pub name: &'static str,
    /// The reading of a correct capture's files that introduces it; `None` for the first photograph at all poses.
    pub reading: Option<Reading>,
}

/// Outcome of checking a capture.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// The alignment check.
    pub alignment: Alignment,
    /// Whether the capture was refused.
    pub detected: bool,
    /// Whether the proposed reading undoes the mistake, or, if no reading can, the cause was identified.
    pub right_remedy: bool,
}

/// Geometric mistakes that affect all photographs alike.
pub fn mistakes() -> Vec<Mistake> {
    let sound = Reading::default();
    let mistake = |name, reading| Mistake {
        name,
        reading: Some(reading),
    };
    let scaled = |mesh_scale| Reading {
        mesh_scale,
        ..sound
    };
    let focal = |focal| Reading { focal, ..sound };
    let axes = |axes| Reading { axes, ..sound };
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
            "photographs of half the size that the lens is for",
            Reading {
                lens_scale: 2.0,
                ..sound
            },
        ),
        mistake("photographs upside down", lies(Orientation::turned(2))),
        mistake(
            "photographs turned by 90°, as EXIF may say",
            lies(Orientation::turned(1)),
        ),
        mistake("photographs mirrored", lies(Orientation::MIRRORED)),
        mistake("photographs shifted by one", Reading { shift: 1, ..sound }),
        Mistake {
            name: "all photographs the same",
            reading: None,
        },
        mistake("poses with OpenCV's axes", axes(Axes::OpenCv)),
        mistake(
            "mesh with z up, poses with y up",
            Reading {
                mesh_turns: 1,
                ..sound
            },
        ),
    ]
}

fn run(bench: &Bench) -> Result<Findings> {
    let mut table = Table::new("room,mistake,agreement,refused,right");
    let mut summary = Summary {
        columns: "mistake | rooms | refused | with the right remedy",
        rows: Vec::new(),
    };
    let mut row = |capture: &Capture, name: &str, outcome: &Outcome| {
        table.row((
            capture.name.as_str(),
            name,
            outcome.alignment.agreement,
            u64::from(outcome.detected),
            u64::from(outcome.right_remedy),
        ));
    };

    // Correct captures: the given one, or the built-in room and rooms of all families.
    let subject = bench.subject.map(|subject| (*subject.capture).clone());
    let mut captures = vec![in_memory(&subject.map_or_else(room::capture, Ok)?)?];
    let first = decide(&captures[0], None)?;
    row(&captures[0], "none", &first);
    let mut sound = vec![first];
    let families = match bench.subject {
        Some(_) => &[],
        None => &Family::ALL[..],
    };
    for family in families {
        for seed in bench.seeds() {
            let so_far = format!("{} of {} refused so far", refused(&sound), sound.len());
            bench.begin(&format!("{} room {seed}, sound; {so_far}", family.name()))?;
            let capture = in_memory(&family.generate(seed, rooms::SIZE)?.capture)?;
            let outcome = decide(&capture, None)?;
            row(&capture, "none", &outcome);
            sound.push(outcome);
            if *family == Family::Plain && captures.len() < MAX_CAPTURES {
                captures.push(capture);
            }
        }
    }

    // Every mistake in the plain rooms and in the first capture.
    let (mut made, mut found, mut mended) = (0, 0, 0);
    for mistake in mistakes() {
        let (mut detected, mut right) = (0, 0);
        for capture in &captures {
            bench.begin(&format!("{}: {}", capture.name, mistake.name))?;
            let outcome = decide(capture, Some(&mistake))?;
            detected += u64::from(outcome.detected);
            right += u64::from(outcome.right_remedy);
            row(capture, mistake.name, &outcome);
        }
        made += captures.len() as u64;
        found += detected;
        mended += right;
        summary.rows.push(vec![
            mistake.name.to_owned(),
            captures.len().to_string(),
            detected.to_string(),
            right.to_string(),
        ]);
    }
    Ok(Findings {
        how: match bench.subject {
            Some(subject) => format!("Mistakes in {}.", subject.name),
            None => format!(
                "Mistakes in the built-in room and in {} plain generated rooms; sound rooms of all {} families.",
                captures.len() - 1,
                Family::ALL.len()
            ),
        },
        tables: vec![("", table)],
        summary,
        seen: vec![
            format!(
                "Of {made} captures with a mistake {found} were refused, {mended} with the right remedy."
            ),
            format!(
                "Of {} sound captures {} were refused, and of {} it was said that it cannot be told. {} of their photographs were said \
                to have another's pose.",
                sound.len(),
                refused(&sound),
                (sound.iter())
                    .filter(|outcome| outcome.alignment.decision == Decision::Doubtful)
                    .count(),
                (sound.iter())
                    .map(|outcome| outcome.alignment.mispaired.len())
                    .sum::<usize>(),
            ),
        ],
        ..Findings::default()
    })
}

/// Number of captures that were refused.
fn refused(outcomes: &[Outcome]) -> usize {
    outcomes.iter().filter(|outcome| outcome.detected).count()
}

/// The capture with its photographs in memory, so that files are read only once.
fn in_memory(capture: &Capture) -> Result<Capture> {
    Ok(capture.at(&load_working(capture, PIXELS)?))
}

/// Introduces `mistake`, if any, and checks the capture.
///
/// # Errors
/// The capture cannot be read.
pub fn decide(capture: &Capture, mistake: Option<&Mistake>) -> Result<Outcome> {
    let mut capture = capture.clone();
    let made = mistake.map(|mistake| mistake.reading);
    match made {
        None => {}
        Some(Some(reading)) => capture = capture.read_as(&reading),
        Some(None) => {
            let first = capture.frames.first().map(|frame| frame.photograph.clone());
            for (frame, first) in capture.frames.iter_mut().zip(first.iter().cycle()) {
                frame.photograph = first.clone();
            }
        }
    }
    let mut working = load_working(&capture, PIXELS)?;
    let scene = Scene::new(&capture.at(&working))?;
    let none_left = leave_out(&capture, &mut working).is_err();
    let alignment = Alignment::new(&scene, &working.photographs);
    let mended = match (&alignment.decision, made) {
        (_, Some(None)) => none_left,
        (Decision::Wrong { reading, .. }, Some(Some(made))) => undone(&made.then(reading)),
        _ => false,
    };
    Ok(Outcome {
        detected: none_left || matches!(alignment.decision, Decision::Wrong { .. }),
        right_remedy: mended,
        alignment,
    })
}

/// Whether a reading is the default one up to the tolerance.
fn undone(reading: &Reading) -> bool {
    let near = |factor: f64| factor.ln().abs() < TOLERANCE;
    let same = Reading {
        mesh_scale: 1.0,
        focal: 1.0,
        lens_scale: 1.0,
        ..*reading
    };
    // Focal length and lens scale have the same effect.
    let focal = reading.focal * reading.lens_scale;
    same.is_default() && near(reading.mesh_scale) && near(focal) && near(reading.lens_scale)
}
