//! Inserted objects: from a request to composites, coarse at once and refined a slice at a time.

use crate::compose::backdrop::Backdrop;
use crate::compose::insert::Insertion as Composite;
use crate::compose::naive::{harmonics_of_estimate, harmonics_of_photographs, paste};
use crate::compose::object::ObjectModel;
use crate::compose::placement::{PlacedObject, Placement};
use crate::error::Result;
use crate::inverse::estimate::Estimate;
use crate::math::sh::Harmonics;
use crate::scene::camera::Camera;
use crate::session::snapshot::{Insertion, OpenCapture, Picture};
use crate::transport::path::PathOptions;
use glam::Vec3;
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Samples a pixel after which a composite counts as done.
const ENOUGH: u32 = 256;
/// How long a slice of work may take, about.
const SLICE: Duration = Duration::from_millis(15);
/// Shortest time between two pictures of the same composite.
const PICTURE: Duration = Duration::from_millis(250);

/// Objects in one frame's photograph, with both kinds of light.
#[derive(Debug)]
pub struct Inserted {
    /// The photograph with the objects, refined pass by pass.
    pub composite: Composite,
    /// Pasted, lit by harmonics of the photographs alone.
    pub naive: Picture,
    /// Pasted, lit by harmonics of the estimate.
    pub naive_estimate: Picture,
}

/// Objects already read, and the photographs' light; both outlast a change of placement.
#[derive(Debug, Default)]
pub struct Library {
    models: HashMap<PathBuf, Arc<ObjectModel>>,
    photographed: Option<Harmonics>,
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
        let photographed = self
            .photographed
            .get_or_insert_with(|| light_of_photographs(capture));
        let naive = paste(
            &backdrop,
            &lit,
            &objects,
            &vec![*photographed; objects.len()],
            Vec3::ONE,
        );
        let estimated: Vec<Harmonics> = objects
            .iter()
            .map(|object| harmonics_of_estimate(&lit, object.center, options, seed))
            .collect();
        let naive_estimate = paste(&backdrop, &lit, &objects, &estimated, backdrop.exposure);
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
        .map(|photograph| Picture {
            width: photograph.width,
            height: photograph.height,
            pixels: photograph.pixels.clone(),
        })
        .collect();
    harmonics_of_photographs(capture.scene.cameras.iter().zip(&pictures))
}

/// A backdrop of a frame at the working resolution.
///
/// # Errors
/// The frame does not exist.
pub fn backdrop(capture: &OpenCapture, estimate: &Estimate, frame: usize) -> Result<Backdrop> {
    let (camera, photograph): (&Camera, _) = capture.frame(frame)?;
    Backdrop::new(frame, camera, photograph, estimate.exposure(frame))
}

/// The worker's insertion under way.
#[derive(Debug, Default)]
pub struct Inserting {
    library: Library,
    placements: Vec<Placement>,
    frame: usize,
    stale: Option<Instant>,
    inserted: Option<Inserted>,
    begun: Option<Instant>,
    /// When the last slice of refinement ended, and how long it took.
    slice: Option<(Instant, Duration)>,
    pictured: Option<Instant>,
    shown: Option<Arc<Insertion>>,
    sequence: u64,
}

impl Inserting {
    /// Replaces the inserted objects.
    pub fn place(&mut self, placements: Vec<Placement>) {
        self.placements = placements;
        self.stale = Some(Instant::now());
    }

    /// The inserted objects.
    pub fn placements(&self) -> &[Placement] {
        &self.placements
    }

    /// Moves to another frame.
    pub fn look(&mut self, frame: usize) {
        if frame != self.frame {
            self.frame = frame;
            self.update();
        }
    }

    /// Takes up another estimate.
    pub fn update(&mut self) {
        if !self.placements.is_empty() {
            self.stale = Some(Instant::now());
        }
    }

    /// Forgets the objects, as when another capture is opened; files stay read.
    pub fn reset(&mut self) {
        self.library.photographed = None;
        *self = Self {
            library: std::mem::take(&mut self.library),
            sequence: self.sequence,
            ..Self::default()
        };
    }

    /// The newest composites.
    pub fn shown(&self) -> Option<Arc<Insertion>> {
        self.shown.clone()
    }

    /// Whether there is more to draw.
    pub fn is_busy(&self) -> bool {
        let refining = |inserted: &Inserted| inserted.composite.samples() < ENOUGH;
        self.stale.is_some() || self.inserted.as_ref().is_some_and(refining)
    }

    /// Draws for a moment, refining for at most about `share` of the time; whether the pictures changed.
    ///
    /// # Errors
    /// An object cannot be read or placed; the objects are then taken away.
    pub fn draw(
        &mut self,
        capture: &OpenCapture,
        estimate: &Estimate,
        options: &PathOptions,
        share: f32,
    ) -> Result<bool> {
        let started = Instant::now();
        if let Some(asked) = self.stale.take() {
            self.begun = Some(asked);
            self.inserted = None;
            let begun = self.begin(capture, estimate, options);
            if begun.is_err() {
                self.placements.clear();
                self.shown = None;
            }
            return begun.map(|()| true);
        }
        let rested = self.slice.is_none_or(|(end, took)| {
            end.elapsed().as_secs_f32() * share >= took.as_secs_f32() * (1.0 - share)
        });
        let Some(inserted) = self.inserted.as_mut().filter(|_| rested) else {
            return Ok(false);
        };
        if inserted.composite.samples() >= ENOUGH {
            return Ok(false);
        }
        let next = inserted.composite.samples() + 1;
        inserted
            .composite
            .refine_to(next, || started.elapsed() < SLICE);
        self.slice = Some((Instant::now(), started.elapsed()));
        let due = self.pictured.is_none_or(|at| at.elapsed() >= PICTURE);
        if due || inserted.composite.samples() >= ENOUGH {
            self.picture();
            return Ok(true);
        }
        Ok(false)
    }

    fn begin(
        &mut self,
        capture: &OpenCapture,
        estimate: &Estimate,
        options: &PathOptions,
    ) -> Result<()> {
        if self.placements.is_empty() {
            self.shown = None;
            return Ok(());
        }
        let objects = self
            .placements
            .iter()
            .map(|placement| {
                let model = self.library.model(&placement.file)?;
                PlacedObject::new(model, placement, &capture.scene).map(Arc::new)
            })
            .collect::<Result<Vec<_>>>()?;
        let backdrop = backdrop(capture, estimate, self.frame)?;
        self.inserted = Some(
            self.library
                .insert(capture, estimate, backdrop, objects, options, 1),
        );
        self.picture();
        Ok(())
    }

    fn picture(&mut self) {
        let Some(inserted) = &self.inserted else {
            return;
        };
        self.sequence += 1;
        self.pictured = Some(Instant::now());
        let shared = |picture: &Picture, earlier: Option<&Arc<Picture>>| match earlier {
            Some(earlier) if **earlier == *picture => earlier.clone(),
            _ => Arc::new(picture.clone()),
        };
        let last = self.shown.as_ref();
        self.shown = Some(Arc::new(Insertion {
            sequence: self.sequence,
            frame: self.frame,
            composite: Arc::new(inserted.composite.composite()),
            naive: shared(&inserted.naive, last.map(|l| &l.naive)),
            naive_estimate: shared(&inserted.naive_estimate, last.map(|l| &l.naive_estimate)),
            samples: inserted.composite.samples(),
            seconds: self.begun.map_or(0.0, |at| at.elapsed().as_secs_f64()),
        }));
    }
}
