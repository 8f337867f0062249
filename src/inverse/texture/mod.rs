//! Fits textures: the albedo of each cell of an object, kept where it improves held-out pixels.
//!
//! The albedo of a diffuse point is its photographed radiance over the radiance of a white surface at that point. The latter
//! (irradiance / π) is traced by full paths through the present estimate and smoothed ([`irradiance`]). The radiance of a lobe
//! is traced per pixel and subtracted, and the rest belongs to the base below it ([`gloss`]). Neighbouring cells are smoothed
//! as much as cross-validation asks for ([`fit`]). A texture is kept if it predicts held-out pixels significantly better than
//! one colour ([`trial`]).

mod cells;
mod coverage;
mod errors;
mod fit;
mod fuse;
mod gloss;
mod irradiance;
mod links;
mod look;
mod normal_matrix;
mod observations;
mod part;
mod surface;
mod trial;
mod whole;

use crate::calibrate::gbuffer::{GBuffer, GBufferPixel};
use crate::calibrate::problem::Problem;
use crate::calibrate::sharpness::Sharpness;
use crate::inverse::estimate::{Estimate, TexelEstimate};
use crate::inverse::settings::Settings;
use crate::inverse::solver::Termination;
use crate::transport::arrival::RayCount;
use crate::transport::path::PathOptions;
use glam::Vec3;
use part::part_of;
use std::sync::Arc;
use surface::TexturedSurface;
pub use trial::Trial;

/// A gain on held-out pixels of this many standard errors is significant.
const SIGNIFICANT: f64 = 4.0;
/// Least number of pixels of an object in the fit.
const MIN_PIXELS: usize = 60;
/// Least number of held-out pixels of an object.
const MIN_HELD_OUT: usize = 10;
/// Fraction of the paths for coarse fits.
const COARSE_PATHS: f64 = 0.4;
/// Number of an object's pixels that suffices for coarse fits: with a twentieth held out, a trial compares 1,000.
const COARSE_PIXELS: usize = 20_000;
/// Width of the cells of coarse fits, relative to the finest ones.
const COARSE_WIDTH: f32 = 2.0;
/// Held-out loss, relative to the best one, above which a state is rejected.
const MAX_LOSS_RATIO: f64 = 1.02;
/// Number of alternations between light and textures, the last one with fine cells.
const SWEEPS: u32 = 2;

/// The inputs of the stage.
#[derive(Debug, Clone, Copy)]
pub struct Task<'a> {
    /// Scene and photographs.
    pub problem: &'a Problem,
    /// What the pixels see.
    pub gbuffer: &'a GBuffer,
    /// Sharpness of the photographs.
    pub sharpness: &'a Sharpness,
    /// Settings of the solve.
    pub settings: &'a Settings,
    /// Number of paths in each sweep.
    pub paths: u64,
    /// Greatest number of bounces.
    pub max_bounces: u32,
}

/// The outcome for one object.
#[derive(Debug, Clone)]
pub struct Attempt {
    /// Object index.
    pub object: usize,
    /// Number of its cells.
    pub cells: usize,
    /// Number of its pixels in the fit.
    pub pixels: usize,
    /// Comparison on held-out pixels; `None` if the fit itself chose one colour.
    pub trial: Option<Trial>,
    /// Whether its texture is kept.
    pub kept: bool,
}

/// The outcome of the stage.
#[derive(Debug, Clone, Default)]
pub struct Refined {
    /// The objects that were tried.
    pub attempts: Vec<Attempt>,
    /// The texels; `None` if no texture is kept.
    pub texels: Option<Arc<TexelEstimate>>,
    /// Object and mean albedo of each textured object, over the cells that pixels see.
    pub means: Vec<(usize, Vec3)>,
    /// Greatest relative change of a mean albedo in the last sweep.
    pub change: f64,
    /// Whether all textures were rejected because together they made held-out pixels worse.
    pub worse: bool,
}

impl Refined {
    /// Sets the textures and mean albedos of an estimate.
    pub fn apply(&self, estimate: &mut Estimate) {
        estimate.texels.clone_from(&self.texels);
        for &(object, mean) in &self.means {
            let object = &mut estimate.objects[object];
            object.albedo = mean;
            if object.albedo_identifiable {
                "its albedo varies over it; this is the mean of what is seen"
                    .clone_into(&mut object.note);
            }
        }
    }

    /// Scales the textures by a factor per object and channel; `object_of` is the object of each triangle.
    pub fn scale(&mut self, factor: impl Fn(usize) -> Vec3, object_of: &[u32]) {
        for (object, mean) in &mut self.means {
            *mean = (*mean * factor(*object)).min(Vec3::ONE);
        }
        if let Some(texels) = &mut self.texels {
            *texels = Arc::new(texels.scaled(factor, object_of));
        }
    }

    /// One sentence on the textures and their gains. `name` gives the names of objects.
    pub fn summary(&self, name: impl Fn(usize) -> String) -> String {
        let kept: Vec<String> = (self.attempts.iter().filter(|a| a.kept))
            .filter_map(|a| {
                let trial = a.trial?;
                Some(format!(
                    "{} ({} cells, squared error of pixels outside the fit {:.0} % less)",
                    name(a.object),
                    a.cells,
                    100.0 * (1.0 - trial.after / trial.before)
                ))
            })
            .collect();
        let (tried, cells) = (self.attempts.len(), self.unknowns());
        if self.worse {
            let refused = (self.attempts.iter()).filter(|a| a.trial.is_some_and(|t| t.is_gain()));
            let refused: Vec<String> = refused.map(|a| name(a.object)).collect();
            return format!(
                "textures of {}, of {tried} objects tried, make held-out pixels worse all together, so none is kept",
                refused.join(", ")
            );
        }
        if kept.is_empty() {
            return format!("none of {tried} objects tried shows more than one colour");
        }
        format!(
            "{cells} unknowns: {}; {} of {tried} objects tried show one colour; mean albedo moved {:.1} % in the last sweep",
            kept.join(", "),
            tried - kept.len(),
            self.change * 100.0
        )
    }

    /// Number of cells of the objects that kept a texture.
    pub fn unknowns(&self) -> usize {
        self.attempts
            .iter()
            .filter(|a| a.kept)
            .map(|a| a.cells)
            .sum()
    }
}

/// A step of the stage.
#[derive(Debug, Clone, Copy, Default)]
pub struct Step {
    /// Rays cast, and paths rejected because they were not finite.
    pub cast: RayCount,
    /// After a fit: root mean square residual of an object's cross-validated pixels, in units of its mean albedo.
    pub residual: Option<f64>,
}

impl Step {
    fn cast(cast: RayCount) -> Self {
        Self {
            cast,
            residual: None,
        }
    }

    fn residual(residual: f64) -> Self {
        Self {
            residual: Some(residual),
            ..Self::default()
        }
    }
}

/// Receives steps and the fraction of the work that is done; its error ends the stage.
pub type Report<'t> = dyn FnMut(Step, f64) -> Result<(), Termination> + 't;

/// Tries a texture on each of the given objects, keeps those that improve held-out pixels, and then alternates between light and
/// textures. A sweep that raises `held_out_loss`, an estimate's loss on held-out pixels, is undone. If `report` ends the stage, the
/// result of the sweeps so far is returned with its error.
pub fn refine(
    task: &Task,
    estimate: &Estimate,
    objects: &[usize],
    held_out_loss: &dyn Fn(&Estimate) -> Option<f64>,
    report: &mut Report,
) -> (Refined, Result<(), Termination>) {
    let mut refinement = Refinement {
        task,
        estimate,
        options: PathOptions {
            max_bounces: task.max_bounces,
            ..PathOptions::default()
        },
        attempts: Vec::new(),
        kept: Vec::new(),
        change: 0.0,
    };
    let candidates = candidates(task, objects);
    let mut ended = refinement.fit_coarse(&candidates, report);
    let mut states = vec![refinement.refined()];
    for sweep in 1..=SWEEPS {
        let texels = states.last().and_then(|state| state.texels.clone());
        if let (Ok(()), Some(texels)) = (&ended, texels) {
            ended = refinement.sweep(sweep, &candidates, texels, report);
            states.push(refinement.refined());
        }
    }
    (latest_good(states, estimate, held_out_loss), ended)
}

/// The latest state whose held-out loss is at most [`MAX_LOSS_RATIO`] times the least, over all states and the estimate without
/// textures.
fn latest_good(
    mut states: Vec<Refined>,
    estimate: &Estimate,
    held_out_loss: &dyn Fn(&Estimate) -> Option<f64>,
) -> Refined {
    if states.iter().all(|state| state.texels.is_none()) {
        return states.pop().unwrap_or_default();
    }
    let loss = |state: &Refined| {
        let mut textured = estimate.clone();
        state.apply(&mut textured);
        held_out_loss(&textured)
    };
    let losses: Vec<Option<f64>> = states.iter().map(loss).collect();
    let flat = held_out_loss(estimate);
    let best = (losses.iter().chain([&flat]).flatten()).fold(f64::INFINITY, |a, b| a.min(*b));
    let good = |loss: &Option<f64>| loss.is_none_or(|loss| loss <= best * MAX_LOSS_RATIO);
    match losses.iter().rposition(good) {
        Some(index) => states.swap_remove(index),
        None => {
            let mut refused = states.pop().unwrap_or_default();
            refused.attempts.iter_mut().for_each(|a| a.kept = false);
            Refined {
                worse: true,
                attempts: refused.attempts,
                ..Refined::default()
            }
        }
    }
}

/// The state of the stage.
struct Refinement<'a> {
    task: &'a Task<'a>,
    estimate: &'a Estimate,
    options: PathOptions,
    attempts: Vec<Attempt>,
    kept: Vec<TexturedSurface>,
    change: f64,
}

impl Refinement<'_> {
    /// Fits each candidate in coarse cells, and keeps those whose texture is significant.
    fn fit_coarse(
        &mut self,
        candidates: &[Candidate],
        report: &mut Report,
    ) -> Result<(), Termination> {
        let lit = self.estimate.lit(&self.task.problem.scene);
        let total: f64 = candidates.iter().map(|c| (c.1.len() as f64).sqrt()).sum();
        for (index, (object, pixels)) in candidates.iter().enumerate() {
            let paths =
                self.task.paths as f64 * COARSE_PATHS * (pixels.len() as f64).sqrt() / total;
            let fraction = index as f64 / candidates.len() as f64 * 0.6;
            let mut done = |step| report(step, fraction);
            done(Step::default())?;
            let glossy = self.estimate.objects[*object].lobe().is_some();
            let part = part_of(pixels, COARSE_PIXELS);
            let Some(mut coarse) =
                TexturedSurface::new(self.task, *object, glossy, &part, COARSE_WIDTH)
            else {
                continue;
            };
            coarse.find(&lit, &self.options, paths as u64, 0, None, &mut done)?;
            let trial = if coarse.is_textured() {
                Some(coarse.try_out(&lit, &self.options, &mut done)?)
            } else {
                None
            };
            let keep = trial.is_some_and(|trial| trial.is_gain());
            self.attempts.push(Attempt {
                object: *object,
                cells: coarse.cell_count(),
                pixels: coarse.pixel_count(),
                trial,
                kept: keep,
            });
            if keep {
                self.kept.push(coarse);
            }
        }
        Ok(())
    }

    /// Traces the light again with the textures `texels`, and fits the textures to it; in fine cells in the last sweep.
    fn sweep(
        &mut self,
        sweep: u32,
        candidates: &[Candidate],
        texels: Arc<TexelEstimate>,
        report: &mut Report,
    ) -> Result<(), Termination> {
        let textured = Estimate {
            texels: Some(texels),
            ..self.estimate.clone()
        };
        let lit = textured.lit(&self.task.problem.scene);
        let last = sweep == SWEEPS;
        let count = self.kept.len();
        let total: f64 = (self.kept.iter())
            .map(|s| (s.pixel_count() as f64).sqrt())
            .sum();
        self.change = 0.0;
        for (index, surface) in self.kept.iter_mut().enumerate() {
            let share = (surface.pixel_count() as f64).sqrt() / total;
            let paths = self.task.paths as f64 * share * if last { 1.0 } else { COARSE_PATHS };
            let fraction = (f64::from(sweep - 1) + index as f64 / count as f64) / f64::from(SWEEPS);
            let mut done = |step| report(step, 0.6 + 0.4 * fraction);
            let before = surface.mean();
            let known = &self.estimate.objects[surface.object];
            let scale_error = known.albedo_stderr / known.albedo.max(Vec3::splat(1e-3));
            let errors = last.then_some(scale_error);
            if last {
                let own = candidates.iter().find(|c| c.0 == surface.object);
                let fine = own.and_then(|(object, pixels)| {
                    TexturedSurface::new(self.task, *object, surface.glossy, pixels, 1.0)
                });
                let Some(mut fine) = fine else {
                    continue;
                };
                fine.find(&lit, &self.options, paths as u64, sweep, errors, &mut done)?;
                *surface = fine;
            } else {
                surface.find(&lit, &self.options, paths as u64, sweep, errors, &mut done)?;
            }
            let change = (surface.mean() - before).abs().max_element();
            self.change = (self.change).max(f64::from(change / before.max_element().max(1e-4)));
        }
        Ok(())
    }

    /// The present state.
    fn refined(&self) -> Refined {
        let mut attempts = self.attempts.clone();
        for attempt in &mut attempts {
            let surface = self.kept.iter().find(|s| s.object == attempt.object);
            attempt.cells = surface.map_or(attempt.cells, TexturedSurface::cell_count);
        }
        let scene = &self.task.problem.scene;
        Refined {
            texels: (!self.kept.is_empty())
                .then(|| Arc::new(whole::texels(scene, self.estimate, &self.kept))),
            means: self.kept.iter().map(|s| (s.object, s.mean())).collect(),
            attempts,
            change: self.change,
            worse: false,
        }
    }
}

/// An object, and its pixels that see nothing else.
type Candidate<'a> = (usize, Vec<&'a GBufferPixel>);

/// Those of the given objects that enough pixels see.
fn candidates<'a>(task: &Task<'a>, objects: &[usize]) -> Vec<Candidate<'a>> {
    let mut index_of = vec![None; task.problem.scene.objects.len()];
    for (index, &object) in objects.iter().enumerate() {
        index_of[object] = Some(index);
    }
    let mut pixels: Vec<Candidate> = objects.iter().map(|&o| (o, Vec::new())).collect();
    for pixel in task.gbuffer.pixels.iter().filter(|p| p.pure) {
        if let Some(&Some(index)) = index_of.get(pixel.object as usize) {
            pixels[index].1.push(pixel);
        }
    }
    pixels.retain(|(_, pixels)| {
        let held_out = pixels.iter().filter(|p| p.held_out).count();
        held_out >= MIN_HELD_OUT && pixels.len() - held_out >= MIN_PIXELS
    });
    pixels
}
