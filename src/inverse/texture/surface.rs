//! One textured object: its cells, their irradiance, and their albedo.

use crate::calibrate::gbuffer::GBufferPixel;
use crate::inverse::solver::Termination;
use crate::inverse::texture::cells::Cells;
use crate::inverse::texture::coverage::Coverage;
use crate::inverse::texture::errors::{standard_errors, with_light};
use crate::inverse::texture::fit::{Measurements, Texture};
use crate::inverse::texture::gloss::trace_gloss;
use crate::inverse::texture::irradiance::{Irradiance, trace};
use crate::inverse::texture::links::Links;
use crate::inverse::texture::look::{FOLDS, RAYS, SeenPixel, sample_pixels};
use crate::inverse::texture::trial::{TestPixel, Trial, compare};
use crate::inverse::texture::{Step, Task};
use crate::transport::lit::LitScene;
use crate::transport::path::PathOptions;
use glam::{DVec3, Vec3};

/// Number of cells traced between two reports.
const SLICE: usize = 2048;
/// Greatest number of paths per cell in each of two sets.
const MAX_SAMPLES: u64 = 256;

/// Cost of a gloss sample, in paths from a cell.
const GLOSS_COST: u64 = 3;
/// Least number of gloss samples per pixel: one for each of its rays.
const MIN_GLOSS: u64 = RAYS as u64;

/// With fewer held-out pixels than this, cross-validated pixels join the trial.
const FEW_HELD_OUT: usize = 1_000;

/// The state of one object.
pub struct TexturedSurface {
    /// Object index.
    pub object: usize,
    /// Whether it has a lobe.
    pub glossy: bool,
    seed: u64,
    /// Its cells.
    pub cells: Cells,
    /// The graph of neighbouring cells.
    pub links: Links,
    /// What the pixels see of the cells.
    pub coverage: Coverage,
    /// The latest texture.
    pub texture: Texture,
    /// The best single albedo for the same pixels and irradiance.
    pub constant: Vec3,
    /// Standard error of each cell's albedo; empty until it is computed.
    pub stderr: Vec<Vec3>,
}

/// Receives what was done; its error ends the stage.
type Done<'d> = dyn FnMut(Step) -> Result<(), Termination> + 'd;

impl TexturedSurface {
    /// Cuts the object into cells, `width` times as wide as the footprints of its pixels; `None` if no usable pixel sees only this
    /// object.
    pub fn new(
        task: &Task,
        object: usize,
        glossy: bool,
        pixels: &[&GBufferPixel],
        width: f32,
    ) -> Option<Self> {
        let (scene, seed) = (&task.problem.scene, task.settings.seed);
        let pixels = sample_pixels(
            task.problem,
            object as u32,
            pixels,
            task.sharpness,
            glossy,
            seed,
        );
        let cells = Cells::new(scene, &pixels, width);
        let coverage = Coverage::new(&cells, pixels);
        if coverage.pixels.iter().all(|p| p.held_out || p.saturated) {
            return None;
        }
        let links = Links::new(scene, &cells);
        Some(Self {
            object,
            glossy,
            seed,
            coverage,
            texture: Texture {
                colors: vec![Vec3::ZERO; cells.count()],
                strength: None,
                without: Vec::new(),
                noise: Vec3::ZERO,
                prior_weight: 0.0,
            },
            constant: Vec3::ZERO,
            stderr: Vec::new(),
            cells,
            links,
        })
    }

    /// Traces the irradiance and fits the texture. `errors`, the relative standard error of the object's overall albedo, asks for
    /// standard errors too.
    pub fn find(
        &mut self,
        lit: &LitScene,
        options: &PathOptions,
        paths: u64,
        sweep: u32,
        errors: Option<Vec3>,
        done: &mut Done,
    ) -> Result<(), Termination> {
        let samples = (paths / (2 * self.cells.count() as u64)).clamp(1, MAX_SAMPLES) as u32;
        let key = (u64::from(sweep) << 32) + self.object as u64;
        let mut irradiance = Irradiance::default();
        for start in (0..self.cells.count()).step_by(SLICE) {
            let range = start..(start + SLICE).min(self.cells.count());
            let part = trace(
                lit,
                &self.cells,
                &self.coverage,
                range,
                samples,
                options,
                [self.seed, key],
            );
            done(Step::cast(part.cast))?;
            irradiance.append(part);
        }
        let light = irradiance.smoothed(&self.links, || done(Step::default()))?;
        done(Step::default())?;
        if self.glossy {
            let samples = paths / (GLOSS_COST * self.coverage.pixels.len() as u64);
            let samples = samples.clamp(MIN_GLOSS, MAX_SAMPLES) as u32;
            for pixels in self.coverage.pixels.chunks_mut(SLICE) {
                let cast = trace_gloss(lit, pixels, samples, options, self.seed, key);
                done(Step::cast(cast))?;
            }
        }
        let fitted: Vec<&SeenPixel> = self
            .coverage
            .pixels
            .iter()
            .filter(|p| !p.held_out)
            .collect();
        let mut measurements =
            Measurements::new(&fitted, &self.coverage.observations, &light.radiance);
        // A highlight is wrong in a whole photograph: whether a glossy object has a texture at all, all folds decide.
        let decides = self.glossy && sweep == 0;
        let min_folds = if decides { FOLDS } else { 1 };
        let known = self.texture.strength;
        self.texture = measurements.fit(&self.links, min_folds, known, |residual| {
            done(Step::residual(residual))
        })?;
        self.constant = measurements.constant;
        done(Step::default())?;
        if let Some(scale_error) = errors {
            let errors = standard_errors(
                &measurements,
                &self.links,
                &self.texture,
                self.seed,
                self.object,
            );
            let light =
                (scale_error * scale_error + Vec3::splat(light.noise * light.noise)).powf(0.5);
            self.stderr = with_light(&errors, &self.texture, light);
        }
        done(Step::default())
    }

    /// Compares the texture with one colour on pixels outside the fit.
    pub fn try_out(
        &self,
        lit: &LitScene,
        options: &PathOptions,
        done: &mut Done,
    ) -> Result<Trial, Termination> {
        // Held-out pixels; if they are few, also each fold with the texture fitted without it. Glossy objects are tested by
        // folds alone, which are whole photographs.
        let colors = self.texture.colors.as_slice();
        let unsaturated = || self.coverage.pixels.iter().filter(|p| !p.saturated);
        let held_out = unsaturated().filter(|p| p.held_out && !self.glossy);
        let mut pixels: Vec<TestPixel> =
            held_out.map(|pixel| TestPixel { pixel, colors }).collect();
        if pixels.len() < FEW_HELD_OUT {
            let left_out = unsaturated().filter(|p| self.glossy || !p.held_out);
            pixels.extend(left_out.filter_map(|pixel| {
                let colors = self.texture.without.get(pixel.fold)?;
                Some(TestPixel { pixel, colors })
            }));
        }
        let trial = compare(
            lit,
            &self.cells,
            &pixels,
            self.constant,
            self.glossy,
            options,
            self.seed,
        );
        done(Step::cast(trial.cast))?;
        Ok(trial)
    }

    /// Whether the fit chose more than one colour.
    pub fn is_textured(&self) -> bool {
        self.texture.strength.is_some()
    }

    /// Number of cells.
    pub fn cell_count(&self) -> usize {
        self.cells.count()
    }

    /// Number of pixels in the fit.
    pub fn pixel_count(&self) -> usize {
        self.coverage.pixels.iter().filter(|p| !p.held_out).count()
    }

    /// Mean albedo over the area that pixels see.
    pub fn mean(&self) -> Vec3 {
        let (mut sum, mut area) = (DVec3::ZERO, 0.0);
        for (color, seen) in self.texture.colors.iter().zip(&self.coverage.areas) {
            sum += color.as_dvec3() * f64::from(*seen);
            area += f64::from(*seen);
        }
        if area > 0.0 {
            (sum / area).as_vec3()
        } else {
            self.constant
        }
    }
}
