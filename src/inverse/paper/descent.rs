//! The state of the descent and one step of it.

use crate::calibrate::problem::Problem;
use crate::inverse::estimate::TexelEstimate;
use crate::inverse::known::Known;
use crate::inverse::paper::adam::Adam;
use crate::inverse::paper::pace::Pace;
use crate::inverse::paper::patches::Patches;
use crate::inverse::paper::pixel::{Draw, PixelGradient, Rendering, draw};
use crate::inverse::paths::trace::Tracer;
use crate::inverse::settings::{Loss, Settings};
use crate::math::color::luminance;
use crate::math::rng::Stream;
use crate::scene::Scene;
use crate::transport::arrival::Cast;
use crate::transport::emitters::Emitters;
use crate::transport::material::{Lobe, TexelColors};
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Batches that trace this many paths or more are spread over threads.
const PARALLEL: u64 = 128;
/// From this level on paths end by chance; before it colours of one or two paths would become too noisy for it.
const BELIEVED_FROM: u32 = 2;
/// No surface is believed to reflect less, so that paths go on from what is dark now.
const MIN_BELIEVED: f32 = 0.8;

/// What shines less than this fraction of the brightest is no lamp once triangles have albedos: the noise of the steps leaves
/// a little emission everywhere. `evaluate` tells lamps by the same share.
const DIM: f32 = 0.01;

/// Everything that a step changes.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Descent {
    /// Albedo of each object, then of each patch; an object's own is not used once it has patches.
    pub albedo: Vec<Vec3>,
    /// Emission of each object.
    pub emission: Vec<Vec3>,
    /// What has an albedo of its own below objects; `None` while objects have one each.
    pub patches: Option<Patches>,
    /// How far the steps have fallen and the batches have grown, see [`Pace`].
    pub level: u32,
    /// The largest channel of each object's albedo when the level began: by chance on it paths end. Not by the present
    /// albedo, or zero would be a fixed point.
    believed: Vec<f32>,
    adam: Adam,
    steps: u64,
    /// For each object its rough specular lobe, where it has one that is known; empty where none has.
    #[serde(skip)]
    lobes: Vec<Option<Lobe>>,
    /// Albedos that keep their value: of patches that no pixel sees, which would wander by the noise of what little light
    /// they send elsewhere. Empty where all are free.
    #[serde(skip)]
    still: Vec<bool>,
    #[serde(skip)]
    traced: Option<Traced>,
}

/// What tracing needs of the state.
#[derive(Debug, Clone)]
struct Traced {
    emitters: Emitters,
    /// The grid of the patches.
    grid: Option<Arc<TexelEstimate>>,
}

/// What one step did.
#[derive(Debug, Clone, Copy)]
pub struct StepOutcome {
    /// Rays cast, and paths dropped because a weight was not finite.
    pub cast: Cast,
    /// Pixels drawn.
    pub pixels: u64,
    /// Paths traced.
    pub paths: u64,
    /// Whether the gradient was finite.
    pub finite: bool,
}

impl Descent {
    /// One albedo and one emission an object, all zero.
    pub fn new(problem: &Problem) -> Self {
        let objects = problem.scene.objects.len();
        Self {
            albedo: vec![Vec3::ZERO; objects],
            emission: vec![Vec3::ZERO; objects],
            patches: None,
            level: 0,
            believed: vec![1.0; objects],
            adam: Adam::new(2 * objects),
            steps: 0,
            lobes: Vec::new(),
            still: Vec::new(),
            traced: None,
        }
    }

    /// The same with lobes that are known, one entry an object: what has one reflects by it, and gives no light.
    pub fn with_lobes(mut self, lobes: Vec<Option<Lobe>>) -> Self {
        self.lobes = lobes;
        self
    }

    /// The lobe of an object, where it is known to have one.
    pub fn lobe(&self, object: usize) -> Option<Lobe> {
        self.lobes.get(object).copied().flatten()
    }

    /// Whether the state is one of this scene's.
    pub fn fits(&self, scene: &Scene) -> bool {
        let (objects, triangles) = (scene.objects.len(), scene.triangles.len());
        let patches = self.patches.as_ref();
        self.emission.len() == objects
            && self.albedo.len() == objects + patches.map_or(0, Patches::len)
            && self.believed.len() == objects
            && self.adam.parameters() == Some(self.albedo.len() + objects)
            && patches.is_none_or(|patches| patches.fit(triangles))
    }

    /// The same with an albedo for each triangle and lamps in place, or with the patches cut that `which` says; parts begin at
    /// the albedo of the whole. The steps begin anew.
    pub fn refined(&self, scene: &Scene, which: &[bool]) -> Self {
        let objects = self.emission.len();
        let mut emission = self.emission.clone();
        let (patches, parents) = match &self.patches {
            None => {
                let brightest = emission
                    .iter()
                    .fold(0.0f32, |most, e| most.max(e.max_element()));
                let is_dim = |e: &&mut Vec3| e.max_element() < DIM * brightest;
                emission
                    .iter_mut()
                    .filter(is_dim)
                    .for_each(|e| *e = Vec3::ZERO);
                let patches = Patches::triangles(scene.triangles.len());
                (patches, scene.object_of.clone())
            }
            Some(patches) => {
                let (patches, parents) = patches.cut(which);
                let above = |parent: u32| parent + objects as u32;
                (patches, parents.into_iter().map(above).collect())
            }
        };
        let mut albedo = self.albedo[..objects].to_vec();
        albedo.extend(parents.iter().map(|&parent| self.albedo[parent as usize]));
        Self {
            adam: Adam::new(albedo.len() + objects),
            albedo,
            emission,
            patches: Some(patches),
            level: 0,
            believed: self.believed.clone(),
            steps: self.steps,
            lobes: self.lobes.clone(),
            still: Vec::new(),
            traced: None,
        }
    }

    /// Goes on with shorter steps and more work in each.
    pub fn slow_down(&mut self) {
        self.level += 1;
        if self.patches.is_none() && self.level >= BELIEVED_FROM {
            let believed = |albedo: &Vec3| albedo.max_element().max(MIN_BELIEVED);
            self.believed = self.albedo.iter().map(believed).collect();
        }
    }

    /// Lets patches keep their albedo that cover none of the pixels counted.
    pub fn keep_still(&mut self, covered: &[u64]) {
        self.still = vec![false; self.emission.len()];
        self.still.extend(covered.iter().map(|&pixels| pixels == 0));
    }

    /// Gives what is known its values.
    pub fn hold(&mut self, scene: &Scene, known: &Known) {
        for (k, pinned) in known.objects() {
            if k >= self.emission.len() {
                continue;
            }
            if let Some(albedo) = pinned.albedo {
                self.albedo[k] = albedo;
                if let Some(patches) = &self.patches {
                    let patches_of_k = (scene.objects[k].triangles.iter())
                        .flat_map(|&triangle| patches.of_triangle(triangle as usize));
                    for patch in patches_of_k {
                        self.albedo[self.emission.len() + patch] = albedo;
                    }
                }
            }
            if let Some(emission) = pinned.emission {
                self.shine(scene, k, emission);
            }
        }
    }

    /// Gives all objects their emission.
    pub fn set_emission(&mut self, emission: Vec<Vec3>) {
        self.emission = emission;
        self.traced = None;
    }

    /// Gives an object an emission.
    fn shine(&mut self, scene: &Scene, object: usize, emission: Vec3) {
        if self.emission[object] != emission {
            self.emission[object] = emission;
            if let Some(traced) = &mut self.traced {
                let area = scene.objects[object].area;
                (traced.emitters).set_weight(object, area * f64::from(luminance(emission)));
            }
        }
    }

    /// One step: a batch of pixels, its gradient, ADAM, and the bounds. A gradient that is not finite changes nothing.
    pub fn step(&mut self, problem: &Problem, settings: &Settings, bounces: u32) -> StepOutcome {
        let uniform = |stream: &mut Stream| draw(problem, settings, stream);
        self.step_on(problem, settings, bounces, &uniform)
    }

    /// A step on pixels that are drawn in another way than uniformly.
    pub fn step_on(
        &mut self,
        problem: &Problem,
        settings: &Settings,
        bounces: u32,
        draw: Draw,
    ) -> StepOutcome {
        let pace = Pace::of(self, settings);
        let step = self.steps;
        // The squared loss of two independent sets has no bias however few the paths are.
        let loss = match self.patches {
            None => settings.loss,
            Some(_) => Loss::L2,
        };
        let pixels: Vec<PixelGradient> = self.render(problem, settings, bounces, |rendering| {
            let pixel = |index: u64| {
                let mut stream = Stream::new(settings.seed, u64::MAX, step, index);
                let drawn = draw(&mut stream)?;
                Some(rendering.gradient(loss, pace.samples, drawn, stream))
            };
            if pace.paths() >= PARALLEL {
                (0..pace.batch).into_par_iter().filter_map(pixel).collect()
            } else {
                (0..pace.batch).filter_map(pixel).collect()
            }
        });

        // Gradient of the batch's mean, with the parameters that it met.
        let (albedos, objects) = (self.albedo.len(), self.emission.len());
        let mut gradient = vec![Vec3::ZERO; albedos + objects];
        let mut is_met = vec![false; albedos + objects];
        for entry in pixels.iter().flat_map(|p| &p.entries) {
            gradient[entry.0 as usize] += entry.1 / pace.batch as f32;
            is_met[entry.0 as usize] = true;
        }
        let outcome = StepOutcome {
            cast: pixels.iter().map(|p| p.cast).sum(),
            pixels: pace.batch,
            paths: pace.paths(),
            finite: gradient.iter().all(|g| g.is_finite()),
        };
        if !outcome.finite {
            return outcome;
        }

        // Step what was met. The penalty also acts on emission that no path met. Once there are patches, what gives no light
        // stays dark.
        let rate = pace.rate(settings, self.steps) as f32;
        self.steps += 1;
        let still = |index: usize| self.still.get(index) == Some(&true);
        let moves: Vec<usize> = (0..albedos).filter(|&i| is_met[i] && !still(i)).collect();
        for index in moves {
            let change = self.adam.step(index, gradient[index], rate);
            self.albedo[index] = (self.albedo[index] + change).clamp(Vec3::ZERO, Vec3::ONE);
        }
        let penalty = Vec3::splat(settings.emission_weight as f32);
        for k in 0..objects {
            let shines = self.emission[k] != Vec3::ZERO;
            if shines || is_met[albedos + k] && self.patches.is_none() {
                let index = albedos + k;
                let change = self.adam.step(index, gradient[index] + penalty, rate);
                let emission = (self.emission[k] + change).max(Vec3::ZERO);
                self.shine(&problem.scene, k, emission);
            }
        }
        outcome
    }

    /// Lets paths be traced by the present values.
    pub fn render<T>(
        &mut self,
        problem: &Problem,
        settings: &Settings,
        bounces: u32,
        work: impl FnOnce(&Rendering) -> T,
    ) -> T {
        let (scene, objects) = (&*problem.scene, self.emission.len());
        let traced = self.traced.get_or_insert_with(|| {
            // Emitters are drawn in proportion to area × luminance of their present emission.
            let weights: Vec<f64> = (scene.objects.iter().zip(&self.emission))
                .map(|(object, emission)| object.area * f64::from(luminance(*emission)))
                .collect();
            let grid = self.patches.as_ref().map(|patches| TexelEstimate {
                colors: Arc::new(TexelColors {
                    layout: patches.layout().clone(),
                    colors: Vec::new(),
                }),
                stderr: Vec::new(),
                seen: Vec::new(),
                textured: vec![true; objects],
            });
            Traced {
                emitters: Emitters::new(scene, &weights),
                grid: grid.map(Arc::new),
            }
        });
        work(&Rendering {
            problem,
            tracer: Tracer {
                scene,
                lights: &traced.emitters,
                measured: None,
                surface_of: &scene.object_of,
                expected_albedo: &self.believed,
                texels: traced.grid.as_deref(),
                lobes: &self.lobes,
                patches: None,
                sky: None,
                outside: None,
                sampling: settings.light_sampling,
                max_bounces: bounces,
                seed: settings.seed,
                stage: 0,
                round: 0,
            },
            patches: self.patches.as_ref(),
            albedo: &self.albedo,
            emission: &self.emission,
        })
    }
}
