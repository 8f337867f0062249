//! Photographs in one go: each relit by the changes made by hand and with the inserted objects in it, at the size of
//! its file.

use crate::compose::backdrop::Backdrop;
use crate::compose::denoise::denoised;
use crate::compose::object::surface::ObjectSurface;
use crate::compose::placement::{PlacedObject, Placement};
use crate::compose::psf_and_grain::PsfAndGrain;
use crate::compose::relight::Relighting;
use crate::compose::write::{write_insertion, write_relit};
use crate::error::Result;
use crate::gpu::{self, Tracer};
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::render::{Renderer, warn_card_failed};
use crate::session::library::{Inserted, Library};
use crate::session::light::path_options;
use crate::session::snapshot::OpenCapture;
use crate::transport::denoise::Denoiser;
use crate::transport::lit::Lit;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What is made of which photographs.
#[derive(Debug, Clone)]
pub struct Photographs {
    /// What they were taken of.
    pub capture: Arc<OpenCapture>,
    /// The light and the materials that were found.
    pub found: Arc<Estimate>,
    /// The same with the changes made by hand.
    pub edited: Arc<Estimate>,
    /// The solve's parameters: depth of paths and seed.
    pub settings: Settings,
    /// The objects to put in; none leaves the composites out.
    pub placements: Vec<Placement>,
    /// Whether the photographs are brought from the light found to the changed one.
    pub relight: bool,
    /// Samples a pixel.
    pub samples: u32,
    /// Whether the light's noise is smoothed.
    pub denoise: Option<Denoiser>,
    /// Whether objects take the blur and the grain of 8-bit photographs.
    pub finish: bool,
    /// Which photographs, by frame.
    pub frames: Vec<usize>,
}

/// What is being done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Doing {
    /// The photograph's frame.
    pub frame: usize,
    /// Fraction of the whole work that is done, 0 to 1.
    pub fraction: f32,
}

/// What was written.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Written {
    /// Photographs that are done.
    pub photographs: usize,
    /// Their files.
    pub files: Vec<PathBuf>,
    /// What was odd about the objects.
    pub warnings: Vec<String>,
}

impl Photographs {
    /// Writes `prefix(frame)`.relit.{exr,png} and the files of an insertion, one photograph after the other. Between
    /// pieces of work `tell` hears how far it is and may end it; what is written by then is whole.
    ///
    /// # Errors
    /// An object or a photograph cannot be read, or a file cannot be written.
    pub fn write(
        &self,
        prefix: &dyn Fn(usize) -> PathBuf,
        tell: &dyn Fn(Doing) -> bool,
    ) -> Result<Written> {
        self.write_made_of(&Renderer::processor(), &[], prefix, tell)
    }

    /// [`Photographs::write`] with light traced by a renderer, and with materials that replace all those of an object's file: one a
    /// placement, in their order; `None`, or none at all, leaves the file's own.
    ///
    /// # Errors
    /// As [`Photographs::write`].
    pub fn write_made_of(
        &self,
        renderer: &Renderer,
        materials: &[Option<ObjectSurface>],
        prefix: &dyn Fn(usize) -> PathBuf,
        tell: &dyn Fn(Doing) -> bool,
    ) -> Result<Written> {
        let mut library = Library::default();
        let mut written = Written::default();
        let mut objects = Vec::new();
        for (index, placement) in self.placements.iter().enumerate() {
            let mut model = library.model(&placement.file)?;
            written.warnings.extend(model.warnings.iter().cloned());
            if let Some(Some(surface)) = materials.get(index) {
                model = Arc::new(model.as_ref().clone().with_material(surface));
            }
            let placed = PlacedObject::new(model, placement, &self.capture.scene)?;
            objects.push(Arc::new(placed));
        }
        let scene = &self.capture.scene;
        let lights =
            (self.relight).then(|| [&self.found, &self.edited].map(|e| Arc::new(e.lit(scene))));
        let mut tracer = if objects.is_empty() {
            None
        } else {
            self.tracer(renderer, &objects)
        };
        let mut relighters = lights.as_ref().and_then(|[before, after]| {
            Some([renderer.tracer(before, &[])?, renderer.tracer(after, &[])?])
        });
        let parts = u8::from(lights.is_some()) + u8::from(!objects.is_empty());
        let mut unseen = !objects.is_empty() && !self.frames.is_empty();
        for (index, &frame) in self.frames.iter().enumerate() {
            let fraction = |part: u8, fraction: f32| {
                let part = (f32::from(part) + fraction) / f32::from(parts.max(1));
                let fraction = (index as f32 + part) / self.frames.len() as f32;
                tell(Doing { frame, fraction })
            };
            let prefix = prefix(frame);
            let lights = lights.as_ref();
            let go_on = |s| fraction(0, s);
            let Some(backdrop) = self.backdrop(frame, lights, &mut relighters, &go_on)? else {
                return Ok(written);
            };
            if lights.is_some() {
                written.files.extend(write_relit(&prefix, &backdrop)?);
            }
            if !objects.is_empty() {
                let go_on = |s| fraction(parts - 1, s);
                if !go_on(0.0) {
                    return Ok(written);
                }
                let Some((files, is_seen)) = self.composite(
                    &mut library,
                    backdrop,
                    &objects,
                    &mut tracer,
                    &prefix,
                    &go_on,
                )?
                else {
                    return Ok(written);
                };
                written.files.extend(files);
                unseen &= !is_seen;
            }
            written.photographs += 1;
        }
        if unseen {
            let none = "no inserted object is seen in any photograph written; check their places and scales".to_owned();
            written.warnings.push(none);
        }
        Ok(written)
    }

    /// The scene with the objects on the renderer's card.
    fn tracer(&self, renderer: &Renderer, objects: &[Arc<PlacedObject>]) -> Option<Tracer> {
        let inserted: Vec<gpu::Inserted<'_>> = objects.iter().map(|o| o.for_card()).collect();
        renderer.tracer(&self.edited.lit(&self.capture.scene), &inserted)
    }

    /// The photograph, relit where there are two lights; `None` if that was ended.
    fn backdrop(
        &self,
        frame: usize,
        lights: Option<&[Arc<Lit>; 2]>,
        tracers: &mut Option<[Tracer; 2]>,
        go_on: &dyn Fn(f32) -> bool,
    ) -> Result<Option<Backdrop>> {
        let camera = self.capture.full_camera(frame)?;
        let photograph = self.capture.full_photograph(frame)?;
        let exposure = self.found.exposure(frame);
        let mut backdrop = Backdrop::new(frame, &camera, &photograph, exposure)?;
        if self.finish && !self.placements.is_empty() {
            backdrop.finish = PsfAndGrain::of(&photograph);
        }
        if let Some(lights) = lights {
            let (options, seed) = (path_options(&self.settings), self.settings.seed);
            let taken = backdrop.clone();
            let mut relighting =
                Relighting::new(taken, lights.clone(), options, seed, self.denoise);
            let samples = self.in_parts();
            let step = step(tracers.is_some());
            for before in (0..samples).step_by(step as usize) {
                let pass = (before + step).min(samples);
                let go_on = || go_on(before as f32 / samples as f32);
                let whole =
                    |r: &mut Relighting, card: &mut [Tracer; 2]| r.refine_on(card, pass, go_on);
                let done = on_card(&mut relighting, tracers, whole);
                if !done.unwrap_or_else(|| relighting.refine_to(pass, go_on)) {
                    return Ok(None);
                }
            }
            backdrop.photograph = Arc::new(relighting.photograph());
        }
        Ok(Some(backdrop))
    }

    /// Independent renders of a picture: two where they are to tell the noise.
    fn halves(&self) -> u32 {
        1 + u32::from(self.denoise.is_some())
    }

    /// Samples a pixel, an even number where two halves tell the noise.
    fn in_parts(&self) -> u32 {
        self.samples.next_multiple_of(self.halves())
    }

    /// Puts the objects in and writes the composites; returns the files and whether any object is seen, or `None` if that was ended.
    fn composite(
        &self,
        library: &mut Library,
        backdrop: Backdrop,
        objects: &[Arc<PlacedObject>],
        tracer: &mut Option<Tracer>,
        prefix: &Path,
        go_on: &dyn Fn(f32) -> bool,
    ) -> Result<Option<(Vec<PathBuf>, bool)>> {
        // What is to be smoothed is made in two independent halves, which tell the noise.
        let parts = self.halves();
        let samples = self.in_parts() / parts;
        let mut made: Vec<Inserted> = Vec::new();
        for part in 0..parts {
            let mut inserted = library.insert(
                &self.capture,
                &self.edited,
                backdrop.clone(),
                objects.to_vec(),
                &path_options(&self.settings),
                self.settings.seed.wrapping_add(u64::from(part)),
            );
            let step = step(tracer.is_some());
            for before in (0..samples).step_by(step as usize) {
                let pass = (before + step).min(samples);
                let done = part as f32 + before as f32 / samples as f32;
                let go_on = || go_on(done / parts as f32);
                let composite = &mut inserted.composite;
                let done = on_card(composite, tracer, |c, card| c.refine_on(card, pass, go_on));
                if !done.unwrap_or_else(|| composite.refine_to(pass, go_on)) {
                    return Ok(None);
                }
            }
            made.push(inserted);
        }
        let (composite, layers) = match &made[..] {
            [a, b] => denoised(
                [&a.composite, &b.composite],
                self.denoise.unwrap_or(Denoiser::Builtin),
            ),
            made => (made[0].composite.composite(), made[0].composite.layers()),
        };
        let behind = &backdrop.photograph;
        let naive = made[0].naive.over(behind);
        let naive_estimate = made[0].naive_estimate.over(behind);
        let is_seen = layers.alpha.iter().any(|&alpha| alpha > 0.0);
        let results = (&composite, layers);
        let files = write_insertion(prefix, &backdrop, results, &naive, &naive_estimate)?;
        Ok(Some((files, is_seen)))
    }
}

/// Samples between two questions whether to go on: a card is kept busy by more than one.
fn step(has_card: bool) -> u32 {
    if has_card { 16 } else { 1 }
}

/// Work done on the card while there is one; `None` where there is none, or where it failed, which is said.
fn on_card<W, C>(
    work: &mut W,
    card: &mut Option<C>,
    refine: impl FnOnce(&mut W, &mut C) -> Result<bool>,
) -> Option<bool> {
    let done = refine(work, card.as_mut()?);
    if let Err(error) = &done {
        warn_card_failed(error);
        *card = None;
    }
    done.ok()
}
