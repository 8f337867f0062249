//! An open capture as a subject of measurements.

use crate::calibrate::problem::Problem;
use crate::capture::truth::Truth;
use crate::error::Result;
use crate::room::Room;
use crate::room::photographs::STORED;
use crate::session::command::Source;
use crate::session::open_capture::OpenCapture;
use crate::study::evaluate::Reference;
use crate::study::experiments::Subject;
use crate::study::trade::Metric;

impl OpenCapture {
    /// What a solver is given.
    pub fn problem(&self) -> Problem {
        Problem {
            scene: self.scene.clone(),
            photographs: self.photographs.clone(),
        }
    }

    /// Measures estimates by the truth if there is one, else by held-out pixels.
    ///
    /// # Errors
    /// The truth is broken.
    pub fn metric(&self) -> Result<Metric> {
        let truth = match &self.source {
            Source::BuiltInRoom => Room::new().truth(STORED.size)?,
            Source::Folder(folder) if folder.join("truth.json").is_file() => Truth::read(folder)?,
            Source::Folder(_) => return Ok(Metric::HeldOut),
        };
        let reference = Reference::new(truth, &self.capture, &self.scene, &self.photographs);
        Ok(Metric::Truth(Box::new(reference)))
    }

    /// The capture as a subject of studies.
    ///
    /// # Errors
    /// The truth is broken.
    pub fn subject(&self) -> Result<Subject> {
        Ok(Subject {
            name: self.name.clone(),
            capture: self.capture.clone(),
            problem: self.problem(),
            metric: self.metric()?,
        })
    }
}
