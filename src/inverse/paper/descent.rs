//! The state of the descent and one step of it.

use super::adam::Adam;
use crate::inverse::cache::derivative::{Gradient, differentiate};
use crate::inverse::cache::trace::Tracer;
use crate::inverse::held_out::is_held_out;
use crate::inverse::known::Known;
use crate::inverse::parameters::Unknowns;
use crate::inverse::settings::{Loss, Settings};
use crate::inverse::solver::Problem;
use crate::math::color::luminance;
use crate::math::rng::Stream;
use crate::scene::Scene;
use crate::transport::arrival::Cast;
use crate::transport::emitters::Emitters;
use crate::transport::material::Lobe;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Batches from this size on are spread over threads.
const PARALLEL: u64 = 256;
/// Doublings of the batch at most; the samples a pixel, on which the bias of an ℓ1 loss depends, go on doubling.
const BATCH_DOUBLINGS: u32 = 2;
/// Halvings taken back when triangles get albedos of their own.
const REFINED: u32 = 3;
/// Draws of a pixel before giving up on finding one that may be used.
const TRIES: u32 = 64;

/// What shares its unknowns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Grain {
    /// All triangles of an object.
    Objects,
    /// Nothing: each triangle has an albedo of its own; lights are fixed.
    Triangles,
}

/// Everything that a step changes.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Descent {
    /// What shares its unknowns.
    pub grain: Grain,
    /// Present values, one entry a surface.
    pub unknowns: Unknowns,
    /// Emission of each object.
    pub lights: Vec<Vec3>,
    /// How often the learning rate was halved and the samples a pixel, and at first the batch, were doubled.
    pub halvings: u32,
    adam: Adam,
    steps: u64,
    /// For each object its rough specular lobe, where it has one that is known; empty where none has.
    #[serde(skip)]
    lobes: Vec<Option<Lobe>>,
    #[serde(skip)]
    emitters: Option<Emitters>,
}

/// What one step did.
#[derive(Debug, Clone, Copy)]
pub struct StepOutcome {
    /// Rays cast, and paths dropped because a weight was not finite.
    pub cast: Cast,
    /// Paths traced.
    pub paths: u64,
    /// Whether the gradient was finite.
    pub finite: bool,
}

/// A pixel of a batch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drawn {
    /// Frame index.
    pub frame: u32,
    /// Row by row from the top left.
    pub pixel: u32,
    /// Factor on its gradient: its chance if drawn uniformly over its chance, or 1 to fit what is drawn more often more.
    pub weight: f32,
}

/// Draws the pixels of a batch; `None` leaves one out.
pub type Draw<'a> = &'a (dyn Fn(&mut Stream) -> Option<Drawn> + Sync);

/// Gradient of the data term of one pixel, per parameter.
struct PixelGradient {
    entries: Vec<(u32, Vec3)>,
    cast: Cast,
}

impl Descent {
    /// Everything at zero.
    pub fn new(problem: &Problem, grain: Grain) -> Self {
        let objects = problem.scene.objects.len();
        let surfaces = match grain {
            Grain::Objects => objects,
            Grain::Triangles => problem.scene.triangles.len(),
        };
        Self {
            grain,
            unknowns: Unknowns {
                albedo: vec![Vec3::ZERO; surfaces],
                emission: vec![Vec3::ZERO; surfaces],
            },
            lights: vec![Vec3::ZERO; objects],
            halvings: 0,
            adam: Adam::new(2 * surfaces),
            steps: 0,
            lobes: Vec::new(),
            emitters: None,
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
        let surfaces = match self.grain {
            Grain::Objects => scene.objects.len(),
            Grain::Triangles => scene.triangles.len(),
        };
        self.unknowns.albedo.len() == surfaces
            && self.unknowns.emission.len() == surfaces
            && self.adam.parameters() == Some(2 * surfaces)
            && self.lights.len() == scene.objects.len()
    }

    /// The same state with an albedo for each triangle, and the lights fixed.
    pub fn refine(&self, problem: &Problem) -> Self {
        self.refine_by(&problem.scene.object_of)
    }

    /// The same with triangles that each take over the values of a surface: of an object, or of the triangle that they
    /// were cut from.
    pub fn refine_by(&self, parents: &[u32]) -> Self {
        let spread = |values: &[Vec3]| {
            let values = parents.iter().map(|&parent| values[parent as usize]);
            values.collect::<Vec<_>>()
        };
        Self {
            grain: Grain::Triangles,
            unknowns: Unknowns {
                albedo: spread(&self.unknowns.albedo),
                emission: spread(&self.unknowns.emission),
            },
            lights: self.lights.clone(),
            halvings: self.halvings.saturating_sub(REFINED),
            adam: Adam::new(2 * parents.len()),
            steps: self.steps,
            lobes: self.lobes.clone(),
            emitters: None,
        }
    }

    /// Gives what is known its values.
    pub fn hold(&mut self, scene: &Scene, known: &Known) {
        for (k, pinned) in known.objects() {
            let Some(object) = scene.objects.get(k) else {
                continue;
            };
            let own = [k as u32];
            let surfaces = match self.grain {
                Grain::Objects => &own[..],
                Grain::Triangles => &object.triangles,
            };
            for &surface in surfaces {
                if let Some(albedo) = pinned.albedo {
                    self.unknowns.albedo[surface as usize] = albedo;
                }
                if let Some(emission) = pinned.emission {
                    self.unknowns.emission[surface as usize] = emission;
                }
            }
            if let Some(emission) = pinned.emission {
                self.lights[k] = emission;
                if let Some(emitters) = &mut self.emitters {
                    emitters.set_weight(k, object.area * f64::from(luminance(emission)));
                }
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
        let scene = &*problem.scene;
        let surfaces = self.unknowns.surfaces();

        // Emitters are drawn in proportion to area × luminance of their present emission.
        let lights = &self.lights;
        let emitters = self.emitters.get_or_insert_with(|| {
            let weights: Vec<f64> = (scene.objects.iter().zip(lights))
                .map(|(object, emission)| object.area * f64::from(luminance(*emission)))
                .collect();
            Emitters::new(scene, &weights)
        });
        let per_triangle: Vec<u32>;
        let surface_of = match self.grain {
            Grain::Objects => &scene.object_of,
            Grain::Triangles => {
                per_triangle = (0..surfaces as u32).collect();
                &per_triangle
            }
        };
        // No path ends on the present albedo, or zero would be a fixed point.
        let believed = vec![1.0; surfaces];
        let tracer = Tracer {
            scene,
            lights: emitters,
            measured: None,
            surface_of,
            believed_albedo: &believed,
            texels: None,
            lobes: &self.lobes,
            patches: None,
            sky: None,
            outside: None,
            sampling: settings.light_sampling,
            max_bounces: bounces,
            seed: settings.seed,
            stage: 0,
            round: 0,
        };

        // Gradient of the batch's mean.
        let batch = settings.batch << self.halvings.min(BATCH_DOUBLINGS);
        let samples = settings.samples << self.halvings;
        let (unknowns, step) = (&self.unknowns, self.steps);
        let pixel = |index: u64| {
            let mut stream = Stream::new(settings.seed, u64::MAX, step, index);
            let drawn = draw(&mut stream)?;
            Some(pixel_gradient(
                problem, settings, &tracer, unknowns, samples, drawn, stream,
            ))
        };
        let pixels: Vec<PixelGradient> = if batch >= PARALLEL {
            (0..batch).into_par_iter().filter_map(pixel).collect()
        } else {
            (0..batch).filter_map(pixel).collect()
        };
        let mut gradient = vec![Vec3::ZERO; 2 * surfaces];
        for entry in pixels.iter().flat_map(|p| &p.entries) {
            gradient[entry.0 as usize] += entry.1 / batch as f32;
        }

        let outcome = StepOutcome {
            cast: pixels.iter().map(|p| p.cast).sum(),
            paths: 2 * batch * samples,
            finite: gradient.iter().all(|g| g.is_finite()),
        };
        if !outcome.finite {
            return outcome;
        }

        // Step every parameter; lights only while they are not fixed.
        let decay = (1.0 - settings.decay).powf(self.steps as f64 / 1000.0)
            * 0.5f64.powi(self.halvings as i32);
        let rate = (settings.learning_rate * decay) as f32;
        self.adam.begin();
        self.steps += 1;
        for (surface, albedo) in self.unknowns.albedo.iter_mut().enumerate() {
            let change = self.adam.step(surface, gradient[surface], rate);
            *albedo = (*albedo + change).clamp(Vec3::ZERO, Vec3::ONE);
        }
        if self.grain == Grain::Objects {
            for k in 0..surfaces {
                let regulariser = Vec3::splat(settings.emission_weight as f32);
                let change =
                    self.adam
                        .step(surfaces + k, gradient[surfaces + k] + regulariser, rate);
                let before = self.lights[k];
                self.lights[k] = (before + change).max(Vec3::ZERO);
                self.unknowns.emission[k] = self.lights[k];
                if self.lights[k] != before {
                    emitters.set_weight(
                        k,
                        scene.objects[k].area * f64::from(luminance(self.lights[k])),
                    );
                }
            }
        }
        outcome
    }
}

/// Differentiates the loss of one pixel: colour and derivative from independent paths.
fn pixel_gradient(
    problem: &Problem,
    settings: &Settings,
    tracer: &Tracer,
    unknowns: &Unknowns,
    samples: u64,
    drawn: Drawn,
    mut stream: Stream,
) -> PixelGradient {
    let mut result = PixelGradient {
        entries: Vec::new(),
        cast: Cast::default(),
    };
    let (frame, pixel) = (drawn.frame, drawn.pixel);
    let photograph = &problem.photographs[frame as usize];
    let camera = &problem.scene.cameras[frame as usize];
    let corner = Vec2::new(
        (pixel % photograph.width) as f32,
        (pixel / photograph.width) as f32,
    );

    let mut gradients = [
        Gradient::new(2 * unknowns.surfaces()),
        Gradient::new(2 * unknowns.surfaces()),
    ];
    let (mut vertices, mut gathered) = (Vec::new(), Vec::new());
    let mut colour = Vec3::ZERO;
    for (set, gradient) in gradients.iter_mut().enumerate() {
        let mut sum = Vec3::ZERO;
        for _ in 0..samples {
            vertices.clear();
            let (rays, finite) = tracer.pixel_path(camera, corner, &mut stream, &mut vertices);
            result.cast.rays += rays;
            result.cast.rejected += u64::from(!finite);
            sum += differentiate(&vertices, unknowns, &[], &mut gathered, gradient);
        }
        if set == 0 {
            colour = sum / samples as f32;
        }
    }

    let residual = colour - photograph.pixels[pixel as usize];
    // What exceeds a saturated value is right.
    let right = photograph.saturated(pixel as usize) & residual.cmpgt(Vec3::ZERO);
    let residual = Vec3::select(right, Vec3::ZERO, residual);
    let slope = match settings.loss {
        Loss::L1 => {
            residual.signum() * Vec3::from_array(residual.to_array().map(|r| f32::from(r != 0.0)))
        }
        Loss::L2 => residual * 2.0,
    } * drawn.weight
        / samples as f32;
    let derivative = &gradients[1];
    result.entries = derivative
        .touched
        .iter()
        .map(|&t| (t, Vec3::from(derivative.values[t as usize]) * slope))
        .collect();
    result
}

/// A pixel uniform over all photographs; `None` where none may be used.
fn draw(problem: &Problem, settings: &Settings, stream: &mut Stream) -> Option<Drawn> {
    let total: usize = problem.photographs.iter().map(|p| p.pixels.len()).sum();
    if total == 0 {
        return None;
    }
    for _ in 0..TRIES {
        let mut at = stream.below(total);
        for (frame, photograph) in problem.photographs.iter().enumerate() {
            if at >= photograph.pixels.len() {
                at -= photograph.pixels.len();
                continue;
            }
            let usable = photograph.is_usable(at);
            if usable && !is_held_out(settings, frame as u32, at as u32) {
                return Some(Drawn {
                    frame: frame as u32,
                    pixel: at as u32,
                    weight: 1.0,
                });
            }
            break;
        }
    }
    None
}
