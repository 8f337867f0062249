//! Spatial detail: the albedo of an object's cells, where pixels held out of the fit ask for it.
//!
//! For a diffuse point, albedo = radiance in the photograph / radiance of a white surface there. The second is traced
//! by full paths with the lights and albedos found so far and smoothed where it varies slowly ([`irradiance`]). Where there is
//! a lobe, what it reflects to each pixel is traced and taken out, and the rest is that of the base below it ([`gloss`]). The
//! first is noisy, so neighbouring cells are pooled as far as pixels left out of the fit ask for ([`fit`]). A texture
//! is kept where it predicts held-out pixels better than one colour does, by more than their noise ([`trial`]).

mod cells;
mod errors;
mod fit;
mod fuse;
mod gloss;
mod irradiance;
mod links;
mod look;
mod observations;
mod surface;
mod trial;
mod whole;

use crate::calibrate::gbuffer::{GBuffer, GBufferPixel};
use crate::calibrate::problem::Problem;
use crate::calibrate::sharpness::Sharpness;
use crate::inverse::estimate::{Estimate, TexelEstimate};
use crate::inverse::settings::Settings;
use crate::inverse::solver::Termination;
use crate::transport::path::PathOptions;
use glam::Vec3;
use std::sync::Arc;
use surface::TexturedSurface;
pub use trial::Trial;

/// A gain on held-out pixels of so many standard errors is no accident.
const SIGNIFICANT: f64 = 4.0;
/// Pixels in the fit and held out that an object needs.
const MIN_PIXELS: usize = 60;
const MIN_HELD_OUT: usize = 10;
/// Fraction of the paths, and width of cells in the finest ones', that are enough to see whether an object has a texture.
const FIRST_LOOK: f64 = 0.4;
const COARSE: f32 = 2.0;
/// A held-out loss so many times the best one is plainly worse.
const PLAINLY: f64 = 1.02;
/// Times that light and texture are found in turn.
const SWEEPS: u32 = 2;

/// What the stage works on.
#[derive(Debug, Clone, Copy)]
pub struct Task<'a> {
    /// Scene and photographs.
    pub problem: &'a Problem,
    /// What the pixels see.
    pub gbuffer: &'a GBuffer,
    /// How sharp the photographs are.
    pub sharpness: &'a Sharpness,
    /// Parameters.
    pub settings: &'a Settings,
    /// Paths to trace in each sweep.
    pub paths: u64,
    /// Longest path in bounces.
    pub max_bounces: u32,
}

/// What happened to one object.
#[derive(Debug, Clone)]
pub struct Attempt {
    /// Object index.
    pub object: usize,
    /// Cells that its surface was cut into.
    pub cells: usize,
    /// Pixels in the fit.
    pub pixels: usize,
    /// How it did on held-out pixels; unset where the fit itself found one colour.
    pub trial: Option<Trial>,
    /// Whether its texture is kept.
    pub kept: bool,
}

/// What was found.
#[derive(Debug, Clone, Default)]
pub struct Refined {
    /// The objects that were tried.
    pub attempts: Vec<Attempt>,
    /// The texels, where any object kept a texture.
    pub texels: Option<Arc<TexelEstimate>>,
    /// Mean albedo of each textured object over what pixels see of it.
    pub means: Vec<(usize, Vec3)>,
    /// Greatest change of a mean albedo in the last sweep, relative.
    pub unrest: f64,
    /// Whether textures were found but made held-out pixels worse all together, so that none is kept.
    pub worse: bool,
}

impl Refined {
    /// Puts the textures into an estimate.
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

    /// Scales the textures as the mean albedos of their objects changed, given factors a channel by
    /// object, and the object of each triangle.
    pub fn scale(&mut self, factor: impl Fn(usize) -> Vec3, object_of: &[u32]) {
        for (object, mean) in &mut self.means {
            *mean = (*mean * factor(*object)).min(Vec3::ONE);
        }
        if let Some(texels) = &mut self.texels {
            *texels = Arc::new(texels.scaled(factor, object_of));
        }
    }

    /// What was added where and what it bought, in a sentence.
    pub fn summary(&self, name: impl Fn(usize) -> String) -> String {
        let kept: Vec<String> = (self.attempts.iter().filter(|a| a.kept))
            .filter_map(|a| {
                let trial = a.trial?;
                Some(format!(
                    "{} ({} cells, squared error of untouched pixels {:.0} % less)",
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
            self.unrest * 100.0
        )
    }

    /// Cells of the objects that kept a texture.
    pub fn unknowns(&self) -> usize {
        self.attempts
            .iter()
            .filter(|a| a.kept)
            .map(|a| a.cells)
            .sum()
    }
}

/// Hears of rays cast, paths dropped and the fraction of the work that is done; may end the stage.
pub type Tell<'t> = dyn FnMut(u64, u64, f64) -> Result<(), Termination> + 't;

/// Tries a texture on each of the given objects, keeps those that held-out pixels ask for, and sweeps over them until
/// light and texture agree. Where the listener ends that early, what was found by then is kept; where light and texture do
/// not come to agree and `judge`, the loss on held-out pixels, gets worse, the state before that.
pub fn refine(
    task: &Task,
    estimate: &Estimate,
    objects: &[usize],
    judge: &dyn Fn(&Estimate) -> Option<f64>,
    tell: &mut Tell,
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
        unrest: 0.0,
    };
    let mut ended = refinement.look(&candidates(task, objects), tell);
    let mut states = vec![refinement.refined()];
    for sweep in 1..=SWEEPS {
        let found = states.last().and_then(|state| state.texels.clone());
        if let (Ok(()), Some(found)) = (&ended, found) {
            ended = refinement.sweep(sweep, found, tell);
            states.push(refinement.refined());
        }
    }
    (latest_good(states, estimate, judge), ended)
}

/// The latest state whose held-out loss is not plainly above that of the best, one colour an object included.
fn latest_good(
    mut states: Vec<Refined>,
    estimate: &Estimate,
    judge: &dyn Fn(&Estimate) -> Option<f64>,
) -> Refined {
    if states.iter().all(|state| state.texels.is_none()) {
        return states.pop().unwrap_or_default();
    }
    let loss = |state: &Refined| {
        let mut textured = estimate.clone();
        state.apply(&mut textured);
        judge(&textured)
    };
    let losses: Vec<Option<f64>> = states.iter().map(loss).collect();
    let flat = judge(estimate);
    let best = (losses.iter().chain([&flat]).flatten()).fold(f64::INFINITY, |a, b| a.min(*b));
    let good = |loss: &Option<f64>| loss.is_none_or(|loss| loss <= best * PLAINLY);
    match losses.iter().rposition(good) {
        Some(place) => states.swap_remove(place),
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
    unrest: f64,
}

impl Refinement<'_> {
    /// Looks at each candidate in coarse cells, and keeps those that show more than one colour.
    fn look(
        &mut self,
        candidates: &[(usize, Vec<&GBufferPixel>)],
        tell: &mut Tell,
    ) -> Result<(), Termination> {
        let lit = self.estimate.lit(&self.task.problem.scene);
        let fractions: f64 = candidates.iter().map(|c| (c.1.len() as f64).sqrt()).sum();
        for (index, (object, pixels)) in candidates.iter().enumerate() {
            let paths =
                self.task.paths as f64 * FIRST_LOOK * (pixels.len() as f64).sqrt() / fractions;
            let fraction = index as f64 / candidates.len() as f64 * 0.6;
            let mut done = |rays, rejected| tell(rays, rejected, fraction);
            done(0, 0)?;
            let glossy = self.estimate.objects[*object].lobe().is_some();
            let Some(mut coarse) = TexturedSurface::new(self.task, *object, glossy, pixels, COARSE)
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

    /// Finds the light as the textures `found` send it on, and the textures, from now on in fine cells, as that light
    /// shows them.
    fn sweep(
        &mut self,
        sweep: u32,
        found: Arc<TexelEstimate>,
        tell: &mut Tell,
    ) -> Result<(), Termination> {
        let textured = Estimate {
            texels: Some(found),
            ..self.estimate.clone()
        };
        let lit = textured.lit(&self.task.problem.scene);
        let count = self.kept.len();
        let fractions: f64 = (self.kept.iter())
            .map(|s| (s.pixel_count() as f64).sqrt())
            .sum();
        self.unrest = 0.0;
        for (index, surface) in self.kept.iter_mut().enumerate() {
            let paths = self.task.paths as f64 * (surface.pixel_count() as f64).sqrt() / fractions;
            let fraction = (f64::from(sweep - 1) + index as f64 / count as f64) / f64::from(SWEEPS);
            let mut done = |rays, rejected| tell(rays, rejected, 0.6 + 0.4 * fraction);
            let before = surface.mean();
            let known = &self.estimate.objects[surface.object];
            let scale_error = known.albedo_stderr / known.albedo.max(Vec3::splat(1e-3));
            let errors = (sweep == SWEEPS).then_some(scale_error);
            if sweep == 1 {
                let Some(mut fine) = surface.recut(&self.task.problem.scene, 1.0) else {
                    continue;
                };
                fine.find(&lit, &self.options, paths as u64, sweep, errors, &mut done)?;
                *surface = fine;
            } else {
                surface.find(&lit, &self.options, paths as u64, sweep, errors, &mut done)?;
            }
            let change = (surface.mean() - before).abs().max_element();
            self.unrest = f64::max(
                self.unrest,
                f64::from(change / before.max_element().max(1e-4)),
            );
        }
        Ok(())
    }

    /// The state as it is now.
    fn refined(&self) -> Refined {
        let mut attempts = self.attempts.clone();
        for attempt in &mut attempts {
            let found = self.kept.iter().find(|s| s.object == attempt.object);
            attempt.cells = found.map_or(attempt.cells, TexturedSurface::cell_count);
        }
        let scene = &self.task.problem.scene;
        Refined {
            texels: (!self.kept.is_empty())
                .then(|| Arc::new(whole::texels(scene, self.estimate, &self.kept))),
            means: self.kept.iter().map(|s| (s.object, s.mean())).collect(),
            attempts,
            unrest: self.unrest,
            worse: false,
        }
    }
}

/// The objects that enough pixels see, with those pixels.
fn candidates<'a>(task: &Task<'a>, objects: &[usize]) -> Vec<(usize, Vec<&'a GBufferPixel>)> {
    let mut of_object = vec![None; task.problem.scene.objects.len()];
    for (place, &object) in objects.iter().enumerate() {
        of_object[object] = Some(place);
    }
    let mut pixels: Vec<(usize, Vec<&GBufferPixel>)> =
        objects.iter().map(|&o| (o, Vec::new())).collect();
    for pixel in task.gbuffer.pixels.iter().filter(|p| p.pure) {
        if let Some(&Some(place)) = of_object.get(pixel.object as usize) {
            pixels[place].1.push(pixel);
        }
    }
    pixels.retain(|(_, pixels)| {
        let held_out = pixels.iter().filter(|p| p.held_out).count();
        held_out >= MIN_HELD_OUT && pixels.len() - held_out >= MIN_PIXELS
    });
    pixels
}
