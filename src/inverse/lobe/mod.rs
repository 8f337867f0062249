//! Rough specular lobes: one an object, only where its photographs show it.
//!
//! What an object reflects of the light around it is gathered once, kept by direction ([`gather`]), and then explained as
//! a diffuse surface or under a lobe of any roughness with no further ray ([`fit`]). An object is tried where photographs
//! of the same spots differ as a lobe would make them ([`screen`]), and its lobe kept where pixels left out of its fit
//! get better by more than their noise, in what they show and in how they differ by view ([`trial`]).

mod fit;
mod gather;
mod observations;
mod screen;
mod trial;

use crate::calibrate::gbuffer::GBuffer;
use crate::calibrate::problem::Problem;
use crate::inverse::estimate::Estimate;
use crate::inverse::solver::Termination;
use crate::transport::arrival::Cast;
use crate::transport::lit::Lit;
use crate::transport::material::Lobe;
use crate::transport::path::PathOptions;
use gather::Gathering;
use glam::{DVec3, Vec3};
use observations::Spot;
pub use trial::Gain;
use trial::{Evidence, find};

/// Evidence of so many standard errors calls for a trial.
const CALLING: f64 = 5.0;
/// A gain of so many standard errors is no accident.
const SIGNIFICANT: f64 = 4.0;
/// Points of a observation in screening, in each of two sets.
const SCREENED_POINTS: u32 = 2;
/// Bounces up to which light is followed in screening.
const SCREENED_BOUNCES: u32 = 2;
/// Observations of an object in the fit, at most.
const MAX_SIGHTS: usize = 1200;
/// Directions at a point in a first fit are drawn by these roughnesses.
const FIRST_DRAWN: [f64; 2] = [0.08, 0.3];
/// Points of a observation in each of two sets, at least and at most: in the first fit, in the second, and where a lobe is found anew.
const FIRST_POINTS: (u64, u64) = (8, 48);
const SECOND_POINTS: (u64, u64) = (12, 96);
const POINTS_ANEW: (u64, u64) = (12, 384);

/// A last fit looks no further than so many times the roughness that directions were drawn by.
const NEAR: f64 = 2.0;

/// What lobes are looked for in.
#[derive(Debug, Clone, Copy)]
pub struct Task<'a> {
    /// Scene and photographs.
    pub problem: &'a Problem,
    /// Key of the random streams.
    pub seed: u64,
    /// Directions to follow for an object in each of its fits, about.
    pub paths: u64,
    /// Longest path in bounces.
    pub max_bounces: u32,
}

/// The best lobe of an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// GGX roughness α.
    pub roughness: f64,
    /// Specular reflectance at normal incidence.
    pub specular: f64,
    /// Albedo of the base.
    pub albedo: DVec3,
    /// Standard errors of albedo, specular and roughness.
    pub errors: [f64; 5],
    /// Gain over a diffuse surface on pixels left out of the fit.
    pub gain: Gain,
    /// The same in differences between photographs of the same spots alone.
    pub by_view: Gain,
}

impl Gain {
    /// Whether it is no accident.
    pub fn is_significant(&self) -> bool {
        self.mean > SIGNIFICANT * self.noise
    }
}

impl Found {
    /// Whether pixels left out of the fit ask for it.
    pub fn is_called_for(&self) -> bool {
        self.gain.is_significant() && self.by_view.is_significant()
    }

    /// As a material's.
    pub fn lobe(&self) -> Lobe {
        Lobe {
            roughness: self.roughness as f32,
            specular: Vec3::splat(self.specular as f32),
        }
    }

    /// Standard error of the albedo.
    pub fn albedo_error(&self) -> Vec3 {
        let [r, g, b, ..] = self.errors;
        DVec3::new(r, g, b).as_vec3()
    }
}

/// Hears of rays cast and paths dropped; may end the stage.
pub type Tell<'t> = dyn FnMut(Cast) -> Result<(), Termination> + 't;

/// The spots of all objects, and what lobes are looked for with.
pub struct Lobes<'a> {
    /// What lobes are looked for in, and with how many paths.
    pub task: Task<'a>,
    spots: Vec<Vec<Spot>>,
}

impl<'a> Lobes<'a> {
    /// Gathers the spots that pixels see.
    pub fn new(task: Task<'a>, gbuffer: &GBuffer) -> Self {
        Self {
            spots: observations::spots(task.problem, gbuffer),
            task,
        }
    }

    fn gathering<'g>(&self, lit: &'g Lit, object: usize, roughnesses: &'g [f64]) -> Gathering<'g> {
        Gathering {
            lit,
            object: object as u32,
            points: SCREENED_POINTS,
            roughnesses,
            options: PathOptions {
                max_bounces: self.task.max_bounces,
                ..PathOptions::default()
            },
            seed: self.task.seed,
            pass: 0,
        }
    }

    /// For each of the given objects, how many standard errors photographs of the same spots speak for a lobe; `None`
    /// where too few spots are seen by several photographs.
    ///
    /// # Errors
    /// Why the solve is to end, where `tell` says so.
    pub fn evidence(
        &self,
        estimate: &Estimate,
        objects: &[usize],
        tell: &mut Tell,
    ) -> Result<Vec<Option<f64>>, Termination> {
        let lit = estimate.lit(&self.task.problem.scene);
        let mut all = Vec::with_capacity(objects.len());
        for &object in objects {
            let mut gathering = self.gathering(&lit, object, &screen::DRAWN);
            gathering.options.max_bounces = SCREENED_BOUNCES.min(self.task.max_bounces);
            // What gives light hides its albedo: that of most things will do.
            let albedo = estimate.objects[object].albedo.max(Vec3::splat(0.05));
            let scene = &self.task.problem.scene;
            let (evidence, cast) =
                screen::evidence(&gathering, scene, &self.spots[object], albedo.as_dvec3());
            tell(cast)?;
            all.push(evidence);
        }
        Ok(all)
    }

    /// Points of each of an object's observations that its paths suffice for, where directions are drawn in so many ways besides
    /// evenly.
    fn points(&self, object: usize, ways: usize, (least, most): (u64, u64)) -> u32 {
        let chosen = observations::choose(&self.spots[object], 1, MAX_SIGHTS);
        let observations: usize = chosen.iter().map(|spot| spot.len()).sum();
        let points = self.task.paths / (2 * (1 + ways) * observations.max(1)) as u64;
        points.clamp(least, most) as u32
    }

    /// Whether evidence calls for a trial.
    pub fn calls(evidence: Option<f64>) -> bool {
        evidence.is_some_and(|t| t > CALLING)
    }

    /// Finds an object's lobe, from nothing or from what was found before; `None` where nothing tells. What is found from
    /// before is by paths of its `turn`, independent of those of other turns.
    ///
    /// # Errors
    /// Why the solve is to end, where `tell` says so.
    pub fn find(
        &self,
        lit: &Lit,
        object: usize,
        emits: bool,
        known: Option<(Lobe, u64)>,
        tell: &mut Tell,
    ) -> Result<Option<Found>, Termination> {
        let scene = &self.task.problem.scene;
        let spots = &self.spots[object];
        let (roughness, pass, points) = match known {
            Some((lobe, turn)) => (f64::from(lobe.roughness), 3 + turn, POINTS_ANEW),
            None => {
                let mut gathering = self.gathering(lit, object, &FIRST_DRAWN);
                gathering.points = self.points(object, FIRST_DRAWN.len(), FIRST_POINTS);
                gathering.pass = 1;
                let (evidence, cast) = Evidence::new(&gathering, scene, spots, MAX_SIGHTS);
                tell(cast)?;
                match find(&evidence, emits, [0.0, 1.0]) {
                    Some(first) => (first.roughness, 2, SECOND_POINTS),
                    None => return Ok(None),
                }
            }
        };
        let drawn = [roughness];
        let mut gathering = self.gathering(lit, object, &drawn);
        gathering.points = self.points(object, drawn.len(), points);
        gathering.pass = pass;
        let (evidence, cast) = Evidence::new(&gathering, scene, spots, MAX_SIGHTS);
        tell(cast)?;
        let near = [roughness / NEAR, roughness * NEAR];
        Ok(find(&evidence, emits, near))
    }
}
