//! Loaded objects, the photographs' light, and the shown photograph, which outlast changes of placement.

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
use crate::math::picture::Picture;
use crate::math::sh::Harmonics;
use crate::session::open_capture::OpenCapture;
use crate::transport::path::PathOptions;
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

/// An insertion into one frame, with its naive variants.
#[derive(Debug)]
pub struct Inserted {
    pub composite: Composite,
    /// Pasted objects, lit by harmonics of the photographs.
    pub naive: Pasted,
    /// Pasted objects, lit by harmonics of the estimate.
    pub naive_estimate: Pasted,
}

/// Loaded objects, the photographs' light, and the last photograph, which outlast changes of placement.
#[derive(Debug, Default)]
pub struct Library {
    models: HashMap<PathBuf, Arc<ObjectModel>>,
    photographed: Option<Harmonics>,
    taken: Option<Taken>,
}

/// A photograph at the size of its display.
#[derive(Debug)]
struct Taken {
    /// Frame and requested long side.
    size: (usize, u32),
    backdrop: Backdrop,
    photograph: Arc<Photograph>,
    finish: Option<PsfAndGrain>,
}

impl Library {
    /// The object in a file; each file is read once.
    pub fn model(&mut self, path: &PathBuf) -> Result<Arc<ObjectModel>> {
        if let Some(model) = self.models.get(path) {
            return Ok(model.clone());
        }
        let model = Arc::new(ObjectModel::read(path)?);
        self.models.insert(path.clone(), model.clone());
        Ok(model)
    }

    /// Drops what belongs to the capture; files stay loaded.
    pub(super) fn forget_capture(&mut self) {
        self.photographed = None;
        self.taken = None;
    }

    /// The photograph of the last backdrop, unchanged.
    pub(super) fn as_taken(&self) -> Option<&Arc<Picture>> {
        Some(&self.taken.as_ref()?.backdrop.photograph)
    }

    /// The backdrop of a frame at a size, with the photograph's blur and grain if `soft`. Cached for the shown frame.
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
            let of_photograph = || PsfAndGrain::of(&taken.photograph);
            backdrop.finish = (taken.finish.get_or_insert_with(of_photograph)).clone();
        }
        self.taken = Some(taken);
        Ok(backdrop)
    }

    /// Inserts objects into a backdrop; the composite has no samples yet.
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
            false => {
                let known = &mut self.photographed;
                *known.get_or_insert_with(|| light_of_photographs(capture))
            }
        };
        let photographed = vec![photographed; objects.len()];
        let as_taken = Exposure::default();
        let naive = Pasted::new(&backdrop, &lit, &objects, &photographed, as_taken);
        let at =
            |object: &Arc<PlacedObject>| harmonics_of_estimate(&lit, object.center, options, seed);
        let estimated: Vec<Harmonics> = objects.iter().map(at).collect();
        let naive_estimate = Pasted::new(&backdrop, &lit, &objects, &estimated, backdrop.exposure);
        Inserted {
            composite: Composite::new(backdrop, lit, objects, *options, seed),
            naive,
            naive_estimate,
        }
    }
}

fn light_of_photographs(capture: &OpenCapture) -> Harmonics {
    let photographs = capture.photographs.iter();
    let pictures: Vec<Picture> = photographs.map(|taken| taken.picture()).collect();
    harmonics_of_photographs(capture.scene.cameras.iter().zip(&pictures))
}
