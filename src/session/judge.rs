//! What tells the errors of a capture's estimates: its truth, where it has one.

use crate::capture::truth::Truth;
use crate::error::Result;
use crate::room::Room;
use crate::room::photographs::KEPT;
use crate::session::command::Source;
use crate::session::snapshot::OpenCapture;
use crate::study::evaluate::Reference;
use crate::study::trade::Judge;

impl OpenCapture {
    /// The truth where there is one, else held-out pixels.
    ///
    /// # Errors
    /// The truth is broken.
    pub fn judge(&self) -> Result<Judge> {
        let truth = match &self.source {
            Source::BuiltInRoom => Room::new().truth(KEPT.size)?,
            Source::Folder(folder) if folder.join("truth.json").is_file() => Truth::read(folder)?,
            Source::Folder(_) => return Ok(Judge::HeldOut),
        };
        let reference = Reference::new(truth, &self.capture, &self.scene, &self.photographs);
        Ok(Judge::Truth(Box::new(reference)))
    }
}
