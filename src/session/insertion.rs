//! Composites of the shown photograph: inserted objects in it, in the light as it was changed, coarse at once and refined
//! a slice at a time.

use crate::capture::exposure::Exposure;
use crate::compose::backdrop::Backdrop;
use crate::compose::finish::Finish;
use crate::compose::insert::Insertion as Composite;
use crate::compose::naive::{Pasted, harmonics_of_estimate, harmonics_of_photographs};
use crate::compose::object::ObjectModel;
use crate::compose::placement::{PlacedObject, Placement};
use crate::compose::relight::Relighting;
use crate::error::{Error, Result};
use crate::inverse::estimate::Estimate;
use crate::math::sh::Harmonics;
use crate::scene::camera::Camera;
use crate::session::light::Light;
use crate::session::snapshot::{Insertion, OpenCapture, Picture};
use crate::transport::path::PathOptions;
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
    pub naive: Pasted,
    /// Pasted, lit by harmonics of the estimate.
    pub naive_estimate: Pasted,
}

/// Objects already read, the photographs' light, and how the last photograph looks; all outlast a change of placement.
#[derive(Debug, Default)]
pub struct Library {
    models: HashMap<PathBuf, Arc<ObjectModel>>,
    photographed: Option<Harmonics>,
    finish: Option<(usize, Finish)>,
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

    /// The blur and the grain of a photograph at the working resolution; found once while it is shown.
    ///
    /// # Errors
    /// The frame does not exist.
    fn finish(&mut self, capture: &OpenCapture, frame: usize) -> Result<Finish> {
        if let Some((known, finish)) = &self.finish
            && *known == frame
        {
            return Ok(finish.clone());
        }
        let finish = Finish::of(capture.frame(frame)?.1);
        self.finish = Some((frame, finish.clone()));
        Ok(finish)
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

/// The shown photograph on its way into the changed light.
#[derive(Debug)]
struct Relit {
    relighting: Relighting,
    light: Light,
    frame: usize,
    /// Samples that the photograph behind the objects was made with.
    samples: u32,
    photograph: Arc<Picture>,
}

/// The worker's composites under way.
#[derive(Debug, Default)]
pub struct Inserting {
    library: Library,
    placements: Vec<Placement>,
    /// Whether they are left without the photograph's blur and grain.
    exact: bool,
    frame: usize,
    stale: Option<Instant>,
    relit: Option<Relit>,
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
        self.update();
    }

    /// The frame that is shown.
    pub fn frame(&self) -> usize {
        self.frame
    }

    /// The inserted objects.
    pub fn placements(&self) -> &[Placement] {
        &self.placements
    }

    /// Chooses whether objects take the blur and the grain of their photograph.
    pub fn take_finish(&mut self, matched: bool) {
        if self.exact == matched {
            self.exact = !matched;
            self.update();
        }
    }

    /// Moves to another frame.
    pub fn look(&mut self, frame: usize) {
        if frame != self.frame {
            self.frame = frame;
            self.update();
        }
    }

    /// Takes up another estimate, or other changes to it.
    pub fn update(&mut self) {
        self.stale = Some(Instant::now());
    }

    /// Forgets the objects, as when another capture is opened; files stay read.
    pub fn reset(&mut self) {
        self.library.photographed = None;
        self.library.finish = None;
        *self = Self {
            library: std::mem::take(&mut self.library),
            exact: self.exact,
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
        self.stale.is_some() || self.samples().is_some_and(|samples| samples < ENOUGH)
    }

    /// Samples a pixel of what has the fewest; `None` where there is nothing to composite.
    fn samples(&self) -> Option<u32> {
        let relit = self.relit.as_ref().map(|relit| relit.relighting.samples());
        let inserted = self
            .inserted
            .as_ref()
            .filter(|_| self.placements.iter().any(|p| !p.hidden));
        let inserted = inserted.map(|inserted| inserted.composite.samples());
        relit.into_iter().chain(inserted).min()
    }

    /// Draws for a moment, refining for at most about `share` of the time; whether the pictures changed.
    ///
    /// # Errors
    /// An object cannot be read or placed, and is taken away; or the frame does not exist, and all are.
    pub fn draw(&mut self, capture: &OpenCapture, light: &Light, share: f32) -> Result<bool> {
        let started = Instant::now();
        if let Some(asked) = self.stale.take() {
            self.begun = Some(asked);
            self.inserted = None;
            return match self.begin(capture, light) {
                Ok(unplaced) => unplaced.map_or(Ok(true), Err),
                Err(error) => {
                    self.placements.clear();
                    self.relit = None;
                    self.shown = None;
                    Err(error)
                }
            };
        }
        let rested = self.slice.is_none_or(|(end, took)| {
            end.elapsed().as_secs_f32() * share >= took.as_secs_f32() * (1.0 - share)
        });
        let Some(samples) = self.samples().filter(|&s| rested && s < ENOUGH) else {
            return Ok(false);
        };
        self.refine(samples + 1, started);
        self.slice = Some((Instant::now(), started.elapsed()));
        let due = self.pictured.is_none_or(|at| at.elapsed() >= PICTURE);
        if due || self.samples() >= Some(ENOUGH) {
            self.picture();
            return Ok(true);
        }
        Ok(false)
    }

    /// Brings what has fewer samples a slice further.
    fn refine(&mut self, samples: u32, started: Instant) {
        let go_on = || started.elapsed() < SLICE;
        if let Some(relit) = &mut self.relit
            && relit.relighting.samples() < samples
        {
            // Smoothing takes longer than a sample: it is done whenever there are twice as many.
            let done = relit.relighting.refine_to(samples, go_on);
            if done && relit.relighting.is_begun() && samples >= 2 * relit.samples {
                relit.samples = samples;
                relit.photograph = Arc::new(relit.relighting.photograph());
                let photograph = relit.photograph.clone();
                if let Some(inserted) = &mut self.inserted {
                    inserted.composite.put_behind(photograph);
                }
            }
        } else if let Some(inserted) = &mut self.inserted {
            inserted.composite.refine_to(samples, go_on);
        }
    }

    /// Begins to composite all that can be; what was wrong with the first object that cannot be read or placed.
    fn begin(&mut self, capture: &OpenCapture, light: &Light) -> Result<Option<Error>> {
        let (mut objects, mut unplaced) = (Vec::new(), None);
        let library = &mut self.library;
        self.placements.retain(|placement| {
            if placement.hidden {
                return true;
            }
            let placed = (library.model(&placement.file))
                .and_then(|model| PlacedObject::new(model, placement, &capture.scene));
            let kept = placed.is_ok();
            match placed {
                Ok(object) => objects.push(Arc::new(object)),
                Err(error) => drop(unplaced.get_or_insert(error)),
            }
            kept
        });
        if objects.is_empty() && !light.is_changed() {
            self.relit = None;
            self.shown = None;
            return Ok(unplaced);
        }
        let mut backdrop = backdrop(capture, &light.found, self.frame)?;
        if !self.exact {
            backdrop.finish = self.library.finish(capture, self.frame)?;
        }
        self.relight(capture, light, &backdrop);
        if let Some(relit) = &self.relit {
            backdrop.photograph = relit.photograph.clone();
        }
        self.inserted = Some(self.library.insert(
            capture,
            &light.edited,
            backdrop,
            objects,
            &light.options,
            light.seed,
        ));
        self.picture();
        Ok(unplaced)
    }

    /// Begins to bring the photograph into the changed light, unless that is under way.
    fn relight(&mut self, capture: &OpenCapture, light: &Light, taken: &Backdrop) {
        if !light.is_changed() {
            self.relit = None;
            return;
        }
        let same = |relit: &Relit| relit.frame == self.frame && relit.light.is(light);
        if self.relit.as_ref().is_some_and(same) {
            return;
        }
        let lights = [&light.found, &light.edited].map(|e| Arc::new(e.lit(&capture.scene)));
        let relighting = Relighting::new(taken.clone(), lights, light.options, light.seed, true);
        self.relit = Some(Relit {
            photograph: Arc::new(relighting.coarse()),
            relighting,
            light: light.clone(),
            frame: self.frame,
            samples: 1,
        });
    }

    fn picture(&mut self) {
        let Some(inserted) = &self.inserted else {
            return;
        };
        self.sequence += 1;
        self.pictured = Some(Instant::now());
        let behind = &inserted.composite.backdrop().photograph;
        let shared = |picture: Picture, earlier: Option<&Arc<Picture>>| match earlier {
            Some(earlier) if **earlier == picture => earlier.clone(),
            _ => Arc::new(picture),
        };
        let last = self.shown.as_ref();
        let naive = inserted.naive.over(behind);
        let naive_estimate = inserted.naive_estimate.over(behind);
        self.shown = Some(Arc::new(Insertion {
            sequence: self.sequence,
            frame: self.frame,
            composite: Arc::new(inserted.composite.composite()),
            naive: shared(naive, last.map(|l| &l.naive)),
            naive_estimate: shared(naive_estimate, last.map(|l| &l.naive_estimate)),
            samples: self.samples().unwrap_or(0),
            seconds: self.begun.map_or(0.0, |at| at.elapsed().as_secs_f64()),
        }));
    }
}
