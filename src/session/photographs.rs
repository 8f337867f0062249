//! Writes photographs at the size of their files, relit by the edits and with the inserted objects.

use crate::compose::backdrop::Backdrop;
use crate::compose::denoise::denoised;
use crate::compose::insert::Insertion;
use crate::compose::placement::{self, PlacedObject, Placement};
use crate::compose::psf_and_grain::PsfAndGrain;
use crate::compose::relight::Relighting;
use crate::compose::write::{write_insertion, write_relit};
use crate::error::Result;
use crate::gpu::Tracer;
use crate::inverse::estimate::Estimate;
use crate::inverse::settings::Settings;
use crate::render::Renderer;
use crate::session::library::Library;
use crate::session::light::path_options;
use crate::session::open_capture::OpenCapture;
use crate::transport::denoise::Denoiser;
use crate::transport::lit::LitScene;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Which photographs to write, and how.
#[derive(Debug, Clone)]
pub struct Photographs {
    /// The open capture.
    pub capture: Arc<OpenCapture>,
    /// The estimate.
    pub found: Arc<Estimate>,
    /// The estimate with the edits.
    pub edited: Arc<Estimate>,
    /// Settings of the solve, for depth of paths and seed.
    pub settings: Settings,
    /// The objects to insert; without any, no composites are written.
    pub placements: Vec<Placement>,
    /// Whether to relight the photographs from `found` to `edited`.
    pub relight: bool,
    /// Samples per pixel.
    pub samples: u32,
    /// The denoiser of the renders, if any.
    pub denoise: Option<Denoiser>,
    /// Whether objects get the blur and grain of 8-bit photographs.
    pub finish: bool,
    /// Frames of the photographs.
    pub frames: Vec<usize>,
    /// What traces the paths.
    pub renderer: Renderer,
}

/// Progress of writing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WriteProgress {
    /// The frame in progress.
    pub frame: usize,
    /// Completed fraction of the whole work, 0 to 1.
    pub fraction: f32,
}

/// What was written.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Written {
    /// Number of completed photographs.
    pub photographs: usize,
    /// Their files.
    pub files: Vec<PathBuf>,
    /// Warnings about the objects.
    pub warnings: Vec<String>,
}

impl Photographs {
    /// Writes `prefix(frame)`.relit.{exr,png} and the files of an insertion for each photograph. `report` is called from time
    /// to time with the progress, and stops the work by returning false; files already written are complete.
    ///
    /// # Errors
    /// An object or a photograph cannot be read, or a file cannot be written.
    pub fn write(
        &self,
        prefix: &dyn Fn(usize) -> PathBuf,
        report: &dyn Fn(WriteProgress) -> bool,
    ) -> Result<Written> {
        let mut library = Library::default();
        let mut written = Written::default();
        let mut objects = Vec::new();
        for placement in &self.placements {
            let model = library.model(&placement.file)?;
            written.warnings.extend(model.warnings.iter().cloned());
            let placed = PlacedObject::new(model, placement, &self.capture.scene)?;
            objects.push(Arc::new(placed));
        }
        let scene = &self.capture.scene;
        let lights =
            (self.relight).then(|| [&self.found, &self.edited].map(|e| Arc::new(e.lit(scene))));
        let placed = Some(&objects).filter(|objects| !objects.is_empty());
        let renderer = &self.renderer;
        let mut tracer = placed
            .and_then(|objects| placement::tracer(renderer, &self.edited.lit(scene), objects));
        let mut relighters = (lights.as_ref()).and_then(|lights| renderer.tracers(lights));
        let parts = u8::from(lights.is_some()) + u8::from(!objects.is_empty());
        let mut unseen = !objects.is_empty() && !self.frames.is_empty();
        for (index, &frame) in self.frames.iter().enumerate() {
            let fraction = |part: u8, fraction: f32| {
                let part = (f32::from(part) + fraction) / f32::from(parts.max(1));
                let fraction = (index as f32 + part) / self.frames.len() as f32;
                report(WriteProgress { frame, fraction })
            };
            let prefix = prefix(frame);
            let lights = lights.as_ref();
            let go_on = |s| fraction(0, s);
            let tracers = &mut relighters;
            let Some(backdrop) = self.backdrop(frame, lights, tracers, &go_on)? else {
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
                let (library, card) = (&mut library, &mut tracer);
                let made = self.composite(library, backdrop, &objects, card, &prefix, &go_on)?;
                let Some((files, is_seen)) = made else {
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

    /// The photograph, relit if there are two lights; `None` if the work was stopped.
    fn backdrop(
        &self,
        frame: usize,
        lights: Option<&[Arc<LitScene>; 2]>,
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
            let samples = self.even_samples();
            let step = step(tracers.is_some());
            for before in (0..samples).step_by(step as usize) {
                let pass = (before + step).min(samples);
                let go_on = || go_on(before as f32 / samples as f32);
                let whole =
                    |r: &mut Relighting, card: &mut [Tracer; 2]| r.refine_on(card, pass, go_on);
                let done = self.renderer.on_card(&mut relighting, tracers, whole);
                if !done.unwrap_or_else(|| relighting.refine_to(pass, go_on)) {
                    return Ok(None);
                }
            }
            backdrop.photograph = Arc::new(relighting.photograph());
        }
        Ok(Some(backdrop))
    }

    /// Independent renders of a picture: the denoiser needs two.
    fn halves(&self) -> u32 {
        1 + u32::from(self.denoise.is_some())
    }

    /// Samples per pixel, a multiple of the number of halves.
    fn even_samples(&self) -> u32 {
        self.samples.next_multiple_of(self.halves())
    }

    /// Inserts the objects and writes the composites. Returns the files, and whether any object is visible; `None` if
    /// the work was stopped.
    fn composite(
        &self,
        library: &mut Library,
        backdrop: Backdrop,
        objects: &[Arc<PlacedObject>],
        tracer: &mut Option<Tracer>,
        prefix: &Path,
        go_on: &dyn Fn(f32) -> bool,
    ) -> Result<Option<(Vec<PathBuf>, bool)>> {
        let (seed, options) = (self.settings.seed, path_options(&self.settings));
        let (capture, edited, objects) = (&self.capture, &self.edited, objects.to_vec());
        let inserted = library.insert(capture, edited, backdrop.clone(), objects, &options, seed);
        // The denoiser needs two independent halves.
        let mut halves = vec![inserted.composite];
        if self.denoise.is_some() {
            halves.push(halves[0].with_seed(seed.wrapping_add(1)));
        }
        let parts = self.halves();
        let samples = self.even_samples() / parts;
        for (part, half) in halves.iter_mut().enumerate() {
            let step = step(tracer.is_some());
            for before in (0..samples).step_by(step as usize) {
                let pass = (before + step).min(samples);
                let done = part as f32 + before as f32 / samples as f32;
                let go_on = || go_on(done / parts as f32);
                let on_card =
                    |half: &mut Insertion, card: &mut Tracer| half.refine_on(card, pass, go_on);
                let done = self.renderer.on_card(half, tracer, on_card);
                if !done.unwrap_or_else(|| half.refine_to(pass, go_on)) {
                    return Ok(None);
                }
            }
        }
        let denoiser = self.denoise.unwrap_or(Denoiser::Builtin);
        let (composite, layers) = match &halves[..] {
            [a, b] => denoised([a, b], denoiser),
            halves => (halves[0].composite(), halves[0].layers()),
        };
        let behind = &backdrop.photograph;
        let naive = inserted.naive.over(behind);
        let naive_estimate = inserted.naive_estimate.over(behind);
        let is_seen = layers.alpha.iter().any(|&alpha| alpha > 0.0);
        let results = (&composite, layers);
        let files = write_insertion(prefix, &backdrop, results, &naive, &naive_estimate)?;
        Ok(Some((files, is_seen)))
    }
}

/// Samples between two calls of `report`; a graphics card needs more work at a time.
fn step(has_card: bool) -> u32 {
    if has_card { 16 } else { 1 }
}
