//! Composites of the shown photograph: relit by the edits and with inserted objects, quickly at first and refined in slices of
//! time.

use crate::compose::backdrop::{Backdrop, LayeredPixel};
use crate::compose::denoise::denoised_composite;
use crate::compose::first_look::first_look;
use crate::compose::insert::Insertion as Composite;
use crate::compose::placement::{self, PlacedObject, Placement};
use crate::compose::relight::Relighting;
use crate::error::{Error, Result};
use crate::gpu::Tracer;
use crate::math::picture::Picture;
use crate::render::Renderer;
use crate::session::library::{Inserted, Library};
use crate::session::light::Light;
use crate::session::open_capture::OpenCapture;
use crate::session::snapshot::Insertion;
use crate::session::view::differs;
use crate::transport::denoise::Denoiser;
use crate::transport::lit::LitScene;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Samples per pixel at which a composite is finished.
const MAX_SAMPLES: u32 = 256;
/// Approximate duration of a slice of work.
const SLICE: Duration = Duration::from_millis(15);
/// Shortest time between two updates to a changing estimate.
const UPDATE_INTERVAL: Duration = Duration::from_secs(2);
/// A new picture replaces one with this many samples only when it has as many; also for pictures with more.
const MIN_REPLACEMENT_SAMPLES: u32 = 8;
/// Below this number of samples a picture is rough, and gets more of the solver's time.
const ROUGH_SAMPLES: u32 = 4;

/// Time that objects rest before the graphics card gets them: its hierarchy takes longer than a slice.
const SETTLED: Duration = Duration::from_millis(150);

/// Long side of the renders that relight a photograph at first, and their samples per pixel.
const FIRST_RELIT: (u32, u32) = (160, 4);
/// Long side of the renders that follow, before those of the photograph's own size, and their samples per pixel.
const SMALL_RELIT: (u32, u32) = (400, 4);

/// The shown photograph, being relit.
#[derive(Debug)]
struct Relit {
    relighting: Relighting,
    lights: [Arc<LitScene>; 2],
    /// The scene in both lights on the graphics card.
    tracers: Option<[Tracer; 2]>,
    /// Smaller renders, which come first.
    small: Option<Relighting>,
    light: Light,
    /// Frame and long side.
    size: (usize, u32),
    /// Samples of `photograph`.
    samples: u32,
    photograph: Arc<Picture>,
}

impl Relit {
    fn new(
        relighting: Relighting,
        lights: [Arc<LitScene>; 2],
        light: &Light,
        size: (usize, u32),
    ) -> Self {
        let mut first = relighting.smaller(FIRST_RELIT.0);
        first.refine_to(FIRST_RELIT.1, || true);
        Self {
            photograph: Arc::new(first.photograph()),
            small: Some(relighting.smaller(SMALL_RELIT.0)),
            relighting,
            lights,
            tracers: None,
            light: light.clone(),
            size,
            samples: 1,
        }
    }

    /// Samples the renders for a slice, up to `samples` per pixel of the photograph. Returns whether the photograph changed.
    fn refine_to(&mut self, renderer: &Renderer, samples: u32, go_on: impl Fn() -> bool) -> bool {
        if let Some(small) = &mut self.small {
            let done = small.refine_to(SMALL_RELIT.1, go_on);
            if done {
                self.photograph = Arc::new(small.photograph());
                self.small = None;
            }
            return done;
        }
        let relighting = &mut self.relighting;
        let mut by_card = None;
        if relighting.is_between_passes() {
            if self.tracers.is_none() {
                self.tracers = renderer.tracers(&self.lights);
            }
            let on_card =
                |r: &mut Relighting, card: &mut [Tracer; 2]| r.refine_on(card, samples, &go_on);
            by_card = renderer.on_card(relighting, &mut self.tracers, on_card);
        }
        let done = by_card.unwrap_or_else(|| relighting.refine_to(samples, &go_on));
        // Denoising takes longer than a sample, so it is done when the samples have doubled.
        let better = done && self.relighting.is_begun() && samples >= 2 * self.samples;
        if better {
            self.samples = samples;
            self.photograph = Arc::new(self.relighting.photograph());
        }
        better
    }
}

/// The inserted objects, being rendered into the photograph.
#[derive(Debug)]
struct Placed {
    inserted: Inserted,
    /// An independent insertion; the denoiser estimates the noise from both.
    independent: Composite,
    /// Shown before there are samples; empty without objects, or if another picture is shown until then.
    first_look: Vec<LayeredPixel>,
    /// Samples of `picture`; 0 while it is the first look.
    samples: u32,
    picture: Arc<Picture>,
    /// The scene with the objects on the graphics card.
    tracer: Option<Tracer>,
}

impl Placed {
    /// `shown` unless another picture stays until this one has samples.
    fn new(inserted: Inserted, seed: u64, shown: bool) -> Self {
        let first_look = match shown && !inserted.composite.objects.is_empty() {
            true => first_look(&inserted.composite),
            false => Vec::new(),
        };
        let mut placed = Self {
            independent: inserted.composite.with_seed(seed),
            first_look,
            samples: 0,
            picture: inserted.composite.backdrop().photograph.clone(),
            tracer: None,
            inserted,
        };
        placed.update_picture();
        placed
    }

    /// Samples per pixel of both insertions together.
    fn samples(&self) -> u32 {
        self.inserted.composite.samples() + self.independent.samples()
    }

    fn set_photograph(&mut self, photograph: &Arc<Picture>) {
        self.inserted.composite.set_photograph(photograph.clone());
        self.independent.set_photograph(photograph.clone());
        self.update_picture();
    }

    fn update_picture(&mut self) {
        let halves = [&self.inserted.composite, &self.independent];
        let backdrop = halves[0].backdrop();
        let sampled = halves.iter().all(|half| half.samples() > 0);
        self.picture = match (sampled, self.first_look.is_empty()) {
            (true, _) => Arc::new(denoised_composite(halves, Denoiser::best())),
            (false, false) => Arc::new(backdrop.composite(&self.first_look)),
            (false, true) => backdrop.photograph.clone(),
        };
        self.samples = if sampled { self.samples() } else { 0 };
    }

    /// Uploads the scene with the objects to the graphics card, unless it is there.
    fn upload(&mut self, renderer: &Renderer) {
        let composite = &self.inserted.composite;
        if self.tracer.is_none() {
            self.tracer = placement::tracer(renderer, &composite.lit, &composite.objects);
        }
    }

    /// Samples both insertions up to `samples` together. Returns whether the picture changed.
    fn refine_to(&mut self, renderer: &Renderer, samples: u32, go_on: impl Fn() -> bool) -> bool {
        let (half, other) = (&mut self.inserted.composite, &mut self.independent);
        let mut refine = |half: &mut Composite, samples| {
            let on_card =
                |half: &mut Composite, card: &mut Tracer| half.refine_on(card, samples, &go_on);
            let done = renderer.on_card(half, &mut self.tracer, on_card);
            done.unwrap_or_else(|| half.refine_to(samples, &go_on))
        };
        let done = refine(half, samples.div_ceil(2)) && refine(other, samples / 2);
        // Denoising takes longer than a sample, so it is done when the samples have doubled.
        let better = done && samples >= 2 && samples >= 2 * self.samples;
        if better {
            self.update_picture();
        }
        better
    }
}

/// The worker's composites in progress.
#[derive(Debug, Default)]
pub struct Inserting {
    library: Library,
    placements: Vec<Placement>,
    /// Whether objects are left without the photograph's blur and grain.
    exact: bool,
    frame: usize,
    /// Long side of the photograph in pixels; 0 if it is not shown.
    long_side: u32,
    stale: Option<Instant>,
    /// The light that the pictures are made in.
    light: Option<Light>,
    /// Samples that new pictures must have before they replace the shown ones.
    hold: u32,
    relit: Option<Relit>,
    placed: Option<Placed>,
    begun: Option<Instant>,
    shown: Option<Arc<Insertion>>,
    sequence: u64,
}

impl Inserting {
    /// Replaces the inserted objects.
    pub fn place(&mut self, placements: Vec<Placement>) {
        self.placements = placements;
        self.update();
    }

    /// The inserted objects.
    pub fn placements(&self) -> &[Placement] {
        &self.placements
    }

    /// Chooses whether objects get the blur and grain of their photograph.
    pub fn match_photograph(&mut self, matched: bool) {
        if self.exact == matched {
            self.exact = !matched;
            self.update();
        }
    }

    /// Shows a frame with a long side in pixels; 0 stops the work.
    pub fn show(&mut self, frame: usize, long_side: u32) {
        if (frame, long_side) != (self.frame, self.long_side) {
            (self.frame, self.long_side) = (frame, long_side);
            self.update();
        }
    }

    /// Shows a frame at the same size as the one before.
    pub fn show_frame(&mut self, frame: usize) {
        self.show(frame, self.long_side);
    }

    /// Starts over with a quick picture.
    pub fn update(&mut self) {
        self.stale = Some(Instant::now());
        self.hold = 0;
    }

    /// Switches to a new estimate if it is visibly different and the last one has been shown for long enough. The
    /// shown picture stays until the new one has as many samples.
    pub fn follow(&mut self, light: &Light) {
        let Some(last) = self.light.as_ref().filter(|_| self.stale.is_none()) else {
            return;
        };
        let first = last.found.objects.is_empty() && !light.found.objects.is_empty();
        let waited = self.begun.map_or(Duration::MAX, |at| at.elapsed());
        let samples = self.samples();
        let refined = samples.is_none_or(|samples| samples >= ROUGH_SAMPLES);
        let pause = UPDATE_INTERVAL * if refined { 1 } else { 5 };
        let rested = self.hold == 0 && waited >= pause;
        if first {
            self.update();
        } else if rested && !last.is_same(light) && differs(&last.edited, &light.edited) {
            self.hold = samples.unwrap_or(0).min(MIN_REPLACEMENT_SAMPLES);
            self.stale = Some(Instant::now());
        }
    }

    /// Drops the objects when another capture is opened; files stay loaded.
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

    /// Whether there is more to render.
    pub fn is_busy(&self) -> bool {
        let more =
            self.stale.is_some() || self.samples().is_some_and(|samples| samples < MAX_SAMPLES);
        self.long_side > 0 && more
    }

    /// Whether the requested picture has few samples.
    pub fn is_rough(&self) -> bool {
        self.is_busy()
            && self.hold == 0
            && self.samples().is_none_or(|samples| samples < ROUGH_SAMPLES)
    }

    /// Fewest samples per pixel of relighting and objects; `None` if there is nothing to composite.
    fn samples(&self) -> Option<u32> {
        let relit = self.relit.as_ref().map(|relit| relit.relighting.samples());
        let placed = (self.placed.as_ref())
            .filter(|placed| !placed.inserted.composite.objects.is_empty())
            .map(Placed::samples);
        relit.into_iter().chain(placed).min()
    }

    /// Renders a slice. Returns whether the pictures changed.
    ///
    /// # Errors
    /// An object cannot be loaded or placed, and is removed; or the frame does not exist, and all objects are removed.
    pub fn draw(
        &mut self,
        renderer: &Renderer,
        capture: &OpenCapture,
        light: &Light,
    ) -> Result<bool> {
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
        let Some(samples) = self.samples().filter(|&s| s < MAX_SAMPLES) else {
            return Ok(false);
        };
        let better = self.refine(renderer, samples + 1, started);
        if better && self.samples() >= Some(self.hold) {
            self.hold = 0;
            self.picture();
            return Ok(true);
        }
        Ok(false)
    }

    /// Refines what has the fewest samples for a slice. Returns whether a picture changed.
    fn refine(&mut self, renderer: &Renderer, samples: u32, started: Instant) -> bool {
        let go_on = || started.elapsed() < SLICE;
        if let Some(relit) = &mut self.relit
            && relit.relighting.samples() < samples
        {
            let better = relit.refine_to(renderer, samples, go_on);
            if let Some(placed) = self.placed.as_mut().filter(|_| better) {
                placed.set_photograph(&relit.photograph);
            }
            return better;
        }
        let Some(placed) = self.placed.as_mut() else {
            return false;
        };
        if self.begun.is_some_and(|begun| begun.elapsed() > SETTLED) {
            placed.upload(renderer);
        }
        placed.refine_to(renderer, samples, go_on)
    }

    /// Starts compositing all objects that can be placed. Returns the error of the first that cannot.
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
        let (library, edited, options) = (&mut self.library, &light.edited, &light.options);
        let inserted = library.insert(capture, edited, backdrop, objects, options, light.seed);
        // With two samples both halves are begun.
        let shown = self.hold < 2;
        self.placed = Some(Placed::new(inserted, light.seed.wrapping_add(1), shown));
        if self.hold == 0 {
            self.picture();
        }
        Ok(unplaced)
    }

    /// Starts relighting the photograph, unless that is in progress already.
    fn relight(&mut self, capture: &OpenCapture, light: &Light, taken: &Backdrop) {
        if !light.is_edited() || light.found.objects.is_empty() {
            self.relit = None;
            return;
        }
        let size = (self.frame, self.long_side);
        let same = |relit: &Relit| relit.size == size && relit.light.is_same(light);
        if self.relit.as_ref().is_some_and(same) {
            return;
        }
        let lights = [&light.found, &light.edited].map(|e| Arc::new(e.lit(&capture.scene)));
        let (taken, denoiser) = (taken.clone(), Some(Denoiser::best()));
        let (options, seed) = (light.options, light.seed);
        let relighting = Relighting::new(taken, lights.clone(), options, seed, denoiser);
        self.relit = Some(Relit::new(relighting, lights, light, size));
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
