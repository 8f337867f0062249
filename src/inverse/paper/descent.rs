//! The state of the descent and one step of it.

use crate::calibrate::problem::Problem;
use crate::inverse::known::Known;
use crate::inverse::paper::adam::Adam;
use crate::inverse::paper::average::Average;
use crate::inverse::paper::pace::Pace;
use crate::inverse::paper::patches::Patches;
use crate::inverse::paper::pixel::{Draw, PixelGradient, Rendering, draw};
use crate::inverse::paths::trace::Tracer;
use crate::inverse::settings::{Loss, Settings};
use crate::math::color::luminance;
use crate::math::rng::Stream;
use crate::scene::Scene;
use crate::transport::arrival::RayCount;
use crate::transport::emitters::{Emitters, powers};
use crate::transport::material::Lobe;
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Batches of at least this many paths are traced in parallel.
const PARALLEL: u64 = 128;
/// Level from which Russian roulette is used; before it colours from one or two paths would become too noisy.
const ROULETTE_FROM: u32 = 2;
/// Least expected albedo for Russian roulette, so that paths continue at surfaces that are dark now.
const MIN_EXPECTED_ALBEDO: f32 = 0.8;

/// Objects with less than this fraction of the greatest emission are no lamps once triangles have albedos: the noise of the
/// steps leaves a little emission everywhere. `evaluate` uses the same fraction.
const DIM: f32 = 0.01;
/// Gradients of a patch before its first step. ADAM's first steps have the size of the rate whatever the gradient, so that rare
/// bright paths would count too little.
const WARM_UP: u32 = 16;

/// The state of the descent.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Descent {
    /// Albedo of each object, then of each patch; albedos of objects are unused once there are patches.
    pub albedo: Vec<Vec3>,
    /// Emission of each object.
    pub emission: Vec<Vec3>,
    /// The parts of triangles with their own albedo; `None` while each object has one albedo.
    pub patches: Option<Patches>,
    /// Number of reductions of the step, see [`Pace`].
    pub level: u32,
    /// The largest channel of each object's albedo at the start of the level, for Russian roulette. The present albedo would make
    /// zero a fixed point.
    expected_albedo: Vec<f32>,
    adam: Adam,
    /// Of the steps of the present level, albedos first, then emissions.
    average: Average,
    steps: u64,
    /// The known rough specular lobe of each object; empty without lobes.
    #[serde(skip)]
    lobes: Vec<Option<Lobe>>,
    /// Whether each albedo is fixed: those of patches that no pixel sees would follow noise. Empty if all are free.
    #[serde(skip)]
    fixed: Vec<bool>,
    #[serde(skip)]
    emitters: Option<Emitters>,
}

/// The outcome of one step.
#[derive(Debug, Clone, Copy)]
pub struct StepOutcome {
    /// Number of rays cast, and of paths rejected because a weight was not finite.
    pub cast: RayCount,
    /// Number of pixels in the batch.
    pub pixels: u64,
    /// Number of paths traced.
    pub paths: u64,
    /// Whether the gradient was finite.
    pub finite: bool,
}

impl Descent {
    /// The start: albedo and emission of each object are zero.
    pub fn new(problem: &Problem) -> Self {
        let objects = problem.scene.objects.len();
        Self {
            albedo: vec![Vec3::ZERO; objects],
            emission: vec![Vec3::ZERO; objects],
            patches: None,
            level: 0,
            expected_albedo: vec![1.0; objects],
            adam: Adam::new(2 * objects),
            average: Average::new(vec![Vec3::ZERO; 2 * objects]),
            steps: 0,
            lobes: Vec::new(),
            fixed: Vec::new(),
            emitters: None,
        }
    }

    /// Sets known lobes, one entry per object. Objects with a lobe emit no light.
    pub fn with_lobes(mut self, lobes: Vec<Option<Lobe>>) -> Self {
        self.lobes = lobes;
        self
    }

    /// The known lobe of an object.
    pub fn lobe(&self, object: usize) -> Option<Lobe> {
        self.lobes.get(object).copied().flatten()
    }

    /// Whether the state's sizes fit the scene.
    pub fn fits(&self, scene: &Scene) -> bool {
        let (objects, triangles) = (scene.objects.len(), scene.triangles.len());
        let patches = self.patches.as_ref();
        self.emission.len() == objects
            && self.albedo.len() == objects + patches.map_or(0, Patches::len)
            && self.expected_albedo.len() == objects
            && self.adam.parameters() == Some(self.albedo.len() + objects)
            && self.average.parameters() == self.adam.parameters()
            && patches.is_none_or(|patches| patches.fit(triangles))
    }

    /// The next refinement: an albedo for each triangle, or the patches in `which` cut into four. Parts start with the albedo of
    /// the whole, dim objects lose their emission, and ADAM and the level start again. Also returns the object of each triangle, or
    /// the old patch of each patch.
    pub fn refined(&self, scene: &Scene, which: &[bool]) -> (Self, Vec<u32>) {
        let objects = self.emission.len();
        let mut emission = self.emission.clone();
        let (patches, parents, first) = match &self.patches {
            None => {
                let brightest = emission
                    .iter()
                    .fold(0.0f32, |max, e| max.max(e.max_element()));
                let is_dim = |e: &&mut Vec3| e.max_element() < DIM * brightest;
                emission
                    .iter_mut()
                    .filter(is_dim)
                    .for_each(|e| *e = Vec3::ZERO);
                let patches = Patches::triangles(scene.triangles.len());
                (patches, scene.object_of.clone(), 0)
            }
            Some(patches) => {
                let (patches, parents) = patches.cut(which);
                (patches, parents, objects)
            }
        };
        let mut albedo = self.albedo[..objects].to_vec();
        albedo.extend((parents.iter()).map(|&parent| self.albedo[first + parent as usize]));
        let refined = Self {
            adam: Adam::new(albedo.len() + objects),
            average: Average::new([&albedo[..], &emission].concat()),
            albedo,
            emission,
            patches: Some(patches),
            level: 0,
            fixed: Vec::new(),
            emitters: None,
            ..self.clone()
        };
        (refined, parents)
    }

    /// Goes to the next level, with shorter steps and larger batches.
    pub fn slow_down(&mut self) {
        self.level += 1;
        self.average.restart();
        if self.patches.is_none() && self.level >= ROULETTE_FROM {
            let expected = |albedo: &Vec3| albedo.max_element().max(MIN_EXPECTED_ALBEDO);
            self.expected_albedo = self.albedo.iter().map(expected).collect();
        }
    }

    /// Fixes the albedos of patches that cover no pixels, given the number of pixels of each patch.
    pub fn fix_uncovered(&mut self, covered: &[u64]) {
        self.fixed = vec![false; self.emission.len()];
        self.fixed.extend(covered.iter().map(|&pixels| pixels == 0));
    }

    /// Sets known parameters to their values.
    pub fn hold(&mut self, scene: &Scene, known: &Known) {
        for (k, pinned) in known.objects() {
            if k >= self.emission.len() {
                continue;
            }
            if let Some(albedo) = pinned.albedo {
                let patches_of_k = self.patches.iter().flat_map(|patches| {
                    (scene.objects[k].triangles.iter())
                        .flat_map(|&triangle| patches.of_triangle(triangle as usize))
                });
                let objects = self.emission.len();
                for index in patches_of_k.map(|patch| objects + patch).chain([k]) {
                    self.albedo[index] = albedo;
                    self.average.set(index, albedo);
                }
            }
            if let Some(emission) = pinned.emission {
                self.average.set(self.albedo.len() + k, emission);
                self.set_object_emission(scene, k, emission);
            }
        }
    }

    /// Albedos and emissions, averaged over the steps of the present level: what a stage yields.
    pub fn averaged(&self) -> (&[Vec3], &[Vec3]) {
        self.average.values().split_at(self.albedo.len())
    }

    /// Sets all parameters.
    pub fn set(&mut self, albedo: Vec<Vec3>, emission: Vec<Vec3>) {
        self.average = Average::new([&albedo[..], &emission].concat());
        self.albedo = albedo;
        self.emission = emission;
        self.emitters = None;
    }

    /// Sets the emission of an object, and its weight for light sampling.
    fn set_object_emission(&mut self, scene: &Scene, object: usize, emission: Vec3) {
        if self.emission[object] != emission {
            self.emission[object] = emission;
            if let Some(emitters) = &mut self.emitters {
                let area = scene.objects[object].area;
                emitters.set_weight(object, area * f64::from(luminance(emission)));
            }
        }
    }

    /// One step: the gradient of a batch of pixels, ADAM, and the bounds. A gradient that is not finite changes nothing.
    pub fn step(&mut self, problem: &Problem, settings: &Settings, bounces: u32) -> StepOutcome {
        let uniform = |stream: &mut Stream| draw(problem, settings, stream);
        self.step_on(problem, settings, bounces, &uniform)
    }

    /// A step on pixels drawn by `draw`.
    pub fn step_on(
        &mut self,
        problem: &Problem,
        settings: &Settings,
        bounces: u32,
        draw: Draw,
    ) -> StepOutcome {
        let pace = Pace::new(self, settings);
        let step = self.steps;
        // The squared loss of two independent sets has no bias for any number of paths.
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

        // Gradient of the batch's mean, and the parameters that its paths met.
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

        // Step what was met. The penalty also acts on emission that no path met. With patches, objects without emission stay dark.
        let rate = pace.rate(settings, self.steps) as f32;
        self.steps += 1;
        for index in 0..albedos {
            if !is_met[index] || self.fixed.get(index) == Some(&true) {
                continue;
            }
            let change = self.adam.step(index, gradient[index], rate);
            if self.patches.is_some() && self.adam.steps(index) <= WARM_UP {
                continue;
            }
            self.albedo[index] = (self.albedo[index] + change).clamp(Vec3::ZERO, Vec3::ONE);
            self.average.add(index, self.albedo[index]);
        }
        let penalty = Vec3::splat(settings.emission_weight as f32);
        for k in 0..objects {
            let emits = self.emission[k] != Vec3::ZERO;
            if emits || is_met[albedos + k] && self.patches.is_none() {
                let index = albedos + k;
                let change = self.adam.step(index, gradient[index] + penalty, rate);
                let emission = (self.emission[k] + change).max(Vec3::ZERO);
                self.set_object_emission(&problem.scene, k, emission);
                self.average.add(index, emission);
            }
        }
        outcome
    }

    /// Runs `work` with a renderer of the present values.
    pub fn render<T>(
        &mut self,
        problem: &Problem,
        settings: &Settings,
        bounces: u32,
        work: impl FnOnce(&Rendering) -> T,
    ) -> T {
        let scene = &*problem.scene;
        let emitters = self.emitters.get_or_insert_with(|| {
            Emitters::new(scene, &powers(scene, self.emission.iter().copied()))
        });
        let patches = self.patches.as_ref();
        work(&Rendering {
            problem,
            tracer: Tracer {
                scene,
                lights: emitters,
                measured: None,
                surface_of: &scene.object_of,
                expected_albedo: &self.expected_albedo,
                texels: patches.map(|patches| (&patches.layout, None)),
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
            patches,
            albedo: &self.albedo,
            emission: &self.emission,
        })
    }
}
