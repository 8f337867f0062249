//! Objects that are read, the photographs' light, and the shown photograph: what outlasts a change of placement.

use crate::capture::exposure::Exposure;
use crate::capture::photograph::Photograph;
use crate::compose::backdrop::Backdrop;
use crate::compose::insert::Insertion as Composite;
use crate::compose::naive::{Pasted, harmonics_of_estimate, harmonics_of_photographs};
use crate::compose::object::ObjectModel;
use crate::compose::placement::PlacedObject;
use crate::compose::psf_and_grain::PsfAndGrain;
use crate::error::Result;
use crate::inverse::estimate::Estimate;
use crate::math::sh::Harmonics;
use crate::session::snapshot::{OpenCapture, Picture};
use crate::transport::path::PathOptions;
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

/// Objects in one frame's photograph, with both kinds of light.
#[derive(Debug)]
pub struct Inserted {
    /// The photograph with the objects, refined pass by pass.
    pub composite: Composite,
    /// Pasted, lit by harmonics of the photographs alone.
    pub naive: Pasted,
    /// Pasted, lit by harmonics of the estimate.
    pub naive_estimate: Pasted,
}

/// Objects already read, the photographs' light, and how the last photograph looks; all outlast a change of placement.
#[derive(Debug, Default)]
pub struct Library {
    models: HashMap<PathBuf, Arc<ObjectModel>>,
    photographed: Option<Harmonics>,
    taken: Option<Taken>,
}

/// A photograph at the size at which it is looked at.
#[derive(Debug)]
struct Taken {
    /// Its frame and how large it was asked for.
    size: (usize, u32),
    backdrop: Backdrop,
    photograph: Arc<Photograph>,
    finish: Option<PsfAndGrain>,
}

impl Library {
    /// The object in a file; read once.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn model(&mut self, path: &PathBuf) -> Result<Arc<ObjectModel>> {
        if let Some(model) = self.models.get(path) {
            return Ok(model.clone());
        }
        let model = Arc::new(ObjectModel::read(path)?);
        self.models.insert(path.clone(), model.clone());
        Ok(model)
    }

    /// Forgets what belongs to the capture; files stay read.
    pub(super) fn forget_capture(&mut self) {
        self.photographed = None;
        self.taken = None;
    }

    /// The photograph that a backdrop was asked for last, as it was taken.
    pub(super) fn as_taken(&self) -> Option<&Arc<Picture>> {
        Some(&self.taken.as_ref()?.backdrop.photograph)
    }

    /// The photograph of a frame at a size, with its blur and grain; found once while it is shown.
    ///
    /// # Errors
    /// The frame does not exist, or its file cannot be read again.
    pub(super) fn backdrop(
        &mut self,
        capture: &OpenCapture,
        frame: usize,
        long_side: u32,
        soft: bool,
    ) -> Result<Backdrop> {
        let known = self.taken.take().filter(|t| t.size == (frame, long_side));
        let mut taken = match known {
            Some(taken) => taken,
            None => {
                let (camera, photograph) = capture.frame_at(frame, long_side)?;
                Taken {
                    size: (frame, long_side),
                    backdrop: Backdrop::new(frame, &camera, &photograph, Exposure::default())?,
                    photograph,
                    finish: None,
                }
            }
        };
        let mut backdrop = taken.backdrop.clone();
        if soft {
            let finish = taken
                .finish
                .get_or_insert_with(|| PsfAndGrain::of(&taken.photograph));
            backdrop.finish = finish.clone();
        }
        self.taken = Some(taken);
        Ok(backdrop)
    }

    /// Puts objects into a backdrop; the composite is coarse at first.
    pub fn insert(
        &mut self,
        capture: &OpenCapture,
        estimate: &Estimate,
        backdrop: Backdrop,
        objects: Vec<Arc<PlacedObject>>,
        options: &PathOptions,
        seed: u64,
    ) -> Inserted {
        let lit = Arc::new(estimate.lit(&capture.scene));
        let photographed = match objects.is_empty() {
            true => Harmonics::default(),
            false => *self
                .photographed
                .get_or_insert_with(|| light_of_photographs(capture)),
        };
        let same = vec![photographed; objects.len()];
        let naive = Pasted::new(&backdrop, &lit, &objects, &same, Exposure::default());
        let estimated: Vec<Harmonics> = objects
            .iter()
            .map(|object| harmonics_of_estimate(&lit, object.center, options, seed))
            .collect();
        let naive_estimate = Pasted::new(&backdrop, &lit, &objects, &estimated, backdrop.exposure);
        Inserted {
            composite: Composite::new(backdrop, lit, objects, *options, seed),
            naive,
            naive_estimate,
        }
    }
}

fn light_of_photographs(capture: &OpenCapture) -> Harmonics {
    let pictures: Vec<Picture> = capture
        .photographs
        .iter()
        .map(|photograph| photograph.picture())
        .collect();
    harmonics_of_photographs(capture.scene.cameras.iter().zip(&pictures))
}
