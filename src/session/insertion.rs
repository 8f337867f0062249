//! Composites of the shown photograph: inserted objects in it, in the light as it was changed, coarse at once and refined
//! a slice at a time.

use crate::compose::backdrop::Backdrop;
use crate::compose::denoise::denoised;
use crate::compose::insert::Insertion as Composite;
use crate::compose::placement::{PlacedObject, Placement};
use crate::compose::relight::Relighting;
use crate::error::{Error, Result};
use crate::session::library::{Inserted, Library};
use crate::session::light::Light;
use crate::session::snapshot::{Insertion, OpenCapture, Picture};
use crate::session::view::differs;
use crate::transport::denoise::Denoiser;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Samples a pixel after which a composite counts as done.
const ENOUGH: u32 = 256;
/// How long a slice of work may take, about.
const SLICE: Duration = Duration::from_millis(15);
/// Shortest time between two looks at a changing estimate.
const FOLLOW: Duration = Duration::from_secs(2);
/// Samples that a picture by a newer estimate has at least before it is shown, where the one before it had as many.
const HOLD: u32 = 8;
/// Samples up to which a picture counts as rough, and has more of the solver's time.
const ROUGH: u32 = 4;

/// The shown photograph on its way into the changed light.
#[derive(Debug)]
struct Relit {
    relighting: Relighting,
    light: Light,
    /// Its frame and how large it is looked at.
    size: (usize, u32),
    /// Samples that the photograph behind the objects was made with.
    samples: u32,
    photograph: Arc<Picture>,
}

/// The inserted objects on their way into the photograph.
#[derive(Debug)]
struct Placed {
    inserted: Inserted,
    /// The same by other random numbers: both together tell the noise, which is smoothed.
    beside: Composite,
    /// Samples that the picture of them was made with; 0 while that is coarse.
    samples: u32,
    picture: Arc<Picture>,
}

impl Placed {
    fn new(inserted: Inserted, seed: u64) -> Self {
        Self {
            beside: inserted.composite.with_seed(seed),
            samples: 0,
            picture: Arc::new(inserted.composite.composite()),
            inserted,
        }
    }

    /// Samples a pixel.
    fn samples(&self) -> u32 {
        self.inserted.composite.samples() + self.beside.samples()
    }

    fn set_photograph(&mut self, photograph: &Arc<Picture>) {
        self.inserted.composite.set_photograph(photograph.clone());
        self.beside.set_photograph(photograph.clone());
        self.paint();
    }

    fn paint(&mut self) {
        let halves = [&self.inserted.composite, &self.beside];
        let none = halves[0].objects().is_empty();
        let told = !none && halves.iter().all(|half| half.samples() > 0);
        self.samples = if told { self.samples() } else { 0 };
        self.picture = Arc::new(match told {
            true => denoised(halves, Denoiser::best()).0,
            false => halves[0].composite(),
        });
    }

    /// Brings both halves to a number of samples together; whether the picture is another.
    fn refine_to(&mut self, samples: u32, go_on: impl Fn() -> bool) -> bool {
        let first = (self.inserted.composite).refine_to(samples.div_ceil(2), &go_on);
        let done = first && self.beside.refine_to(samples / 2, &go_on);
        // Smoothing takes longer than a sample: it is done whenever there are twice as many.
        let better = done && samples >= 2 && samples >= 2 * self.samples;
        if better {
            self.paint();
        }
        better
    }
}

/// The worker's composites under way.
#[derive(Debug, Default)]
pub struct Inserting {
    library: Library,
    placements: Vec<Placement>,
    /// Whether they are left without the photograph's blur and grain.
    exact: bool,
    frame: usize,
    /// How large the photograph is looked at; 0 where nobody does.
    long_side: u32,
    stale: Option<Instant>,
    /// The light that the pictures were begun with.
    light: Option<Light>,
    /// Samples that new pictures must have before they are shown in place of those there are.
    hold: u32,
    relit: Option<Relit>,
    placed: Option<Placed>,
    begun: Option<Instant>,
    /// When the last slice of refinement ended, and how long it took.
    slice: Option<(Instant, Duration)>,
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

    /// Moves to another frame, or looks at it with other pixels along its long side; 0 of them stop the work.
    pub fn look(&mut self, frame: usize, long_side: u32) {
        if (frame, long_side) != (self.frame, self.long_side) {
            (self.frame, self.long_side) = (frame, long_side);
            self.update();
        }
    }

    /// Moves to another frame, looked at as the one before.
    pub fn turn_to(&mut self, frame: usize) {
        self.look(frame, self.long_side);
    }

    /// Begins anew, coarsely at once.
    pub fn update(&mut self) {
        self.stale = Some(Instant::now());
        self.hold = 0;
    }

    /// Takes up another estimate where that differs to the eye and the last one had its time. What is shown stays until the new
    /// picture is as good.
    pub fn follow(&mut self, light: &Light) {
        let Some(last) = self.light.as_ref().filter(|_| self.stale.is_none()) else {
            return;
        };
        let first = last.found.objects.is_empty() && !light.found.objects.is_empty();
        let waited = self.begun.map_or(Duration::MAX, |at| at.elapsed());
        let told = self.samples().is_none_or(|samples| samples >= ROUGH);
        let rested = self.hold == 0 && waited >= if told { FOLLOW } else { 5 * FOLLOW };
        if first {
            self.update();
        } else if rested && !last.is(light) && differs(&last.edited, &light.edited) {
            self.hold = self.samples().unwrap_or(0).min(HOLD);
            self.stale = Some(Instant::now());
        }
    }

    /// Forgets the objects, as when another capture is opened; files stay read.
    pub fn reset(&mut self) {
        self.library.forget_capture();
        *self = Self {
            library: std::mem::take(&mut self.library),
            exact: self.exact,
            long_side: self.long_side,
            stale: Some(Instant::now()),
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
        let more = self.stale.is_some() || self.samples().is_some_and(|samples| samples < ENOUGH);
        self.long_side > 0 && more
    }

    /// Whether what a person asked for has few samples.
    pub fn is_rough(&self) -> bool {
        self.is_busy() && self.hold == 0 && self.samples().is_none_or(|samples| samples < ROUGH)
    }

    /// Samples a pixel of what has the fewest; `None` where there is nothing to composite.
    fn samples(&self) -> Option<u32> {
        let relit = self.relit.as_ref().map(|relit| relit.relighting.samples());
        let placed = (self.placed.as_ref())
            .filter(|placed| !placed.inserted.composite.objects().is_empty())
            .map(Placed::samples);
        relit.into_iter().chain(placed).min()
    }

    /// Draws for a moment, refining for at most about `fraction` of the time; whether the pictures changed.
    ///
    /// # Errors
    /// An object cannot be read or placed, and is taken away; or the frame does not exist, and all are.
    pub fn draw(&mut self, capture: &OpenCapture, light: &Light, fraction: f32) -> Result<bool> {
        let started = Instant::now();
        if let Some(asked) = self.stale.take() {
            self.begun = Some(asked);
            self.placed = None;
            self.light = Some(light.clone());
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
            end.elapsed().as_secs_f32() * fraction >= took.as_secs_f32() * (1.0 - fraction)
        });
        let Some(samples) = self.samples().filter(|&s| rested && s < ENOUGH) else {
            return Ok(false);
        };
        let better = self.refine(samples + 1, started);
        self.slice = Some((Instant::now(), started.elapsed()));
        if better && self.samples() >= Some(self.hold) {
            self.hold = 0;
            self.picture();
            return Ok(true);
        }
        Ok(false)
    }

    /// Brings what has fewer samples a slice further; whether a picture is better by it.
    fn refine(&mut self, samples: u32, started: Instant) -> bool {
        let go_on = || started.elapsed() < SLICE;
        if let Some(relit) = &mut self.relit
            && relit.relighting.samples() < samples
        {
            // Smoothing takes longer than a sample: it is done whenever there are twice as many.
            let done = relit.relighting.refine_to(samples, go_on);
            let better = done && relit.relighting.is_begun() && samples >= 2 * relit.samples;
            if better {
                relit.samples = samples;
                relit.photograph = Arc::new(relit.relighting.photograph());
                if let Some(placed) = &mut self.placed {
                    placed.set_photograph(&relit.photograph);
                }
            }
            return better;
        }
        let placed = self.placed.as_mut();
        placed.is_some_and(|placed| placed.refine_to(samples, go_on))
    }

    /// Begins to composite all that can be; what was wrong with the first object that cannot be read or placed.
    fn begin(&mut self, capture: &OpenCapture, light: &Light) -> Result<Option<Error>> {
        let (mut objects, mut unplaced) = (Vec::new(), None);
        let library = &mut self.library;
        let solved = !light.found.objects.is_empty();
        self.placements.retain(|placement| {
            if placement.hidden {
                return true;
            }
            let placed = (library.model(&placement.file))
                .and_then(|model| PlacedObject::new(model, placement, &capture.scene));
            let kept = placed.is_ok();
            match placed {
                Ok(object) => objects.extend(solved.then(|| Arc::new(object))),
                Err(error) => drop(unplaced.get_or_insert(error)),
            }
            kept
        });
        let soft = !self.exact && !objects.is_empty();
        let mut backdrop = (self.library).backdrop(capture, self.frame, self.long_side, soft)?;
        backdrop.exposure = light.found.exposure(self.frame);
        self.relight(capture, light, &backdrop);
        if let Some(relit) = &self.relit {
            backdrop.photograph = relit.photograph.clone();
        }
        let inserted = self.library.insert(
            capture,
            &light.edited,
            backdrop,
            objects,
            &light.options,
            light.seed,
        );
        self.placed = Some(Placed::new(inserted, light.seed.wrapping_add(1)));
        if self.hold == 0 {
            self.picture();
        }
        Ok(unplaced)
    }

    /// Begins to bring the photograph into the changed light, unless that is under way.
    fn relight(&mut self, capture: &OpenCapture, light: &Light, taken: &Backdrop) {
        if !light.is_changed() || light.found.objects.is_empty() {
            self.relit = None;
            return;
        }
        let size = (self.frame, self.long_side);
        let same = |relit: &Relit| relit.size == size && relit.light.is(light);
        if self.relit.as_ref().is_some_and(same) {
            return;
        }
        let lights = [&light.found, &light.edited].map(|e| Arc::new(e.lit(&capture.scene)));
        let relighting = Relighting::new(
            taken.clone(),
            lights,
            light.options,
            light.seed,
            Some(Denoiser::best()),
        );
        self.relit = Some(Relit {
            photograph: Arc::new(relighting.coarse()),
            relighting,
            light: light.clone(),
            size,
            samples: 1,
        });
    }

    fn picture(&mut self) {
        let Some(placed) = &self.placed else {
            return;
        };
        self.sequence += 1;
        let inserted = &placed.inserted;
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
            photograph: self.library.as_taken().unwrap_or(behind).clone(),
            composite: placed.picture.clone(),
            naive: shared(naive, last.map(|l| &l.naive)),
            naive_estimate: shared(naive_estimate, last.map(|l| &l.naive_estimate)),
            samples: self.samples(),
            seconds: self.begun.map_or(0.0, |at| at.elapsed().as_secs_f64()),
        }));
    }
}
