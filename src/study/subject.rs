//! What a study solves: a scene with photographs, and its truth if known.

use crate::calibrate::problem::Problem;
use crate::capture::Capture;
use crate::capture::photograph::Photograph;
use crate::capture::truth::Truth;
use crate::capture::working::{WORKING_PIXELS, load_working};
use crate::error::Result;
use crate::room::Room;
use crate::room::photographs::{self, Rendering};
use crate::scene::Scene;
use crate::study::evaluate::Reference;
use crate::study::trade::Metric;
use std::sync::Arc;

/// A named problem with its truth.
#[derive(Debug, Clone)]
pub struct Subject {
    /// Display name.
    pub name: String,
    /// The capture.
    pub capture: Arc<Capture>,
    /// The scene and its photographs.
    pub problem: Problem,
    /// Measures estimates, by the truth if known.
    pub metric: Metric,
}

impl Subject {
    /// A room, with rendered photographs.
    ///
    /// # Errors
    /// The room's mesh is empty.
    pub fn of_room(room: &Room, rendering: &Rendering) -> Result<Self> {
        Self::of_photographs(room, photographs::render(room, rendering)?)
    }

    /// A room with photographs of it, one a view and all of one size.
    ///
    /// # Errors
    /// The room's mesh is empty, or there is no photograph.
    pub fn of_photographs(room: &Room, photographs: Vec<Photograph>) -> Result<Self> {
        let size = photographs.first().map_or([0; 2], |p| [p.width, p.height]);
        let capture = room.capture_of(photographs, size);
        let frames = capture.frames.iter();
        let photographs: Vec<_> = frames.map(|frame| frame.load()).collect::<Result<_>>()?;
        let scene = Scene::new(&capture)?;
        let truth: Truth = room.truth(size)?;
        let reference = Reference::new(truth, &capture, &scene, &photographs);
        Ok(Self {
            name: room.name.clone(),
            capture: Arc::new(capture),
            problem: Problem {
                scene: Arc::new(scene),
                photographs,
            },
            metric: Metric::Truth(Box::new(reference)),
        })
    }

    /// The same with photographs at the resolution that the program solves at.
    ///
    /// # Errors
    /// A photograph cannot be read.
    pub fn at_working_resolution(&self) -> Result<Self> {
        let working = load_working(&self.capture, WORKING_PIXELS)?;
        let scene = Scene::new(&self.capture.at(&working))?;
        Ok(Self {
            problem: Problem {
                scene: Arc::new(scene),
                photographs: working.photographs,
            },
            ..self.clone()
        })
    }

    /// The truth, if known.
    pub fn truth(&self) -> Option<&Reference> {
        match &self.metric {
            Metric::Truth(reference) => Some(reference),
            Metric::HeldOut => None,
        }
    }
}
