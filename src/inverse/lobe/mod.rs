//! Fits one rough specular lobe per object, where its photographs show one.
//!
//! The incident radiance at an object is sampled once and stored by direction ([`gather`]). A diffuse surface, or a lobe of any
//! roughness, is then fitted without further rays ([`fit`]). An object is tried if photographs of the same spots differ as a
//! lobe predicts ([`screen`]). Its lobe is kept if it improves cross-validated pixels significantly, both in their radiance and
//! in their differences between views ([`trial`]).

mod fit;
mod gather;
mod observations;
mod screen;
mod trial;

use crate::calibrate::gbuffer::GBuffer;
use crate::calibrate::problem::Problem;
use crate::inverse::estimate::Estimate;
use crate::inverse::solver::Termination;
use crate::transport::arrival::RayCount;
use crate::transport::lit::LitScene;
use crate::transport::material::Lobe;
use crate::transport::path::PathOptions;
use gather::Gathering;
use glam::{DVec3, Vec3};
use observations::Spot;
pub use trial::Gain;
use trial::{LitObservations, find};

/// Evidence of this many standard errors leads to a trial.
const MIN_EVIDENCE: f64 = 5.0;
/// A gain of this many standard errors is significant.
const SIGNIFICANT: f64 = 4.0;
/// Points per observation in screening, in each of two sets.
const SCREENED_POINTS: u32 = 2;
const SCREENED_BOUNCES: u32 = 2;
/// Greatest number of observations of an object in the fit.
const MAX_OBSERVATIONS: usize = 1200;
/// GGX roughnesses that directions are sampled from in the first fit.
const FIRST_DRAWN: [f64; 2] = [0.08, 0.3];
/// Least and greatest number of points per observation and set in the first fit, ...
const FIRST_POINTS: (u64, u64) = (8, 48);
/// ... in the second fit, whose directions are sampled from the roughness of the first, ...
const SECOND_POINTS: (u64, u64) = (12, 96);
/// ... and if a known lobe is fitted again.
const REFIT_POINTS: (u64, u64) = (12, 384);

/// Paths of a second trial over those of the first.
const SECOND_TRIAL_PATHS: u64 = 4;
/// Key of the paths of a second trial; those of refits are 0 and 1.
const SECOND_TRIAL: u64 = 2;
/// Greatest ratio between the roughness of the last fit and the sampled one.
const NEAR: f64 = 2.0;

/// The best lobe of an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LobeFit {
    /// GGX roughness α.
    pub roughness: f64,
    /// Specular reflectance at normal incidence.
    pub specular: f64,
    /// Albedo of the base.
    pub albedo: DVec3,
    /// Standard errors of RGB albedo, specular and roughness.
    pub errors: [f64; 5],
    /// Cross-validated gain over a diffuse surface.
    pub gain: Gain,
    /// The same for differences between photographs of the same spots.
    pub by_view: Gain,
}

impl Gain {
    /// Whether it is more than four standard errors above zero.
    pub fn is_significant(&self) -> bool {
        self.mean > SIGNIFICANT * self.noise
    }
}

impl LobeFit {
    /// Whether both gains are significant.
    pub fn is_significant(&self) -> bool {
        self.gain.is_significant() && self.by_view.is_significant()
    }

    /// Whether both gains are at least half of what is significant, so that more paths may decide.
    pub fn is_likely(&self) -> bool {
        [self.gain, self.by_view]
            .iter()
            .all(|gain| gain.mean > 0.5 * SIGNIFICANT * gain.noise)
    }

    /// The lobe of a material.
    pub fn lobe(&self) -> Lobe {
        Lobe::grey(self.roughness as f32, self.specular as f32)
    }

    /// Standard error of the albedo.
    pub fn albedo_error(&self) -> Vec3 {
        let [r, g, b, ..] = self.errors;
        DVec3::new(r, g, b).as_vec3()
    }
}

/// Receives the numbers of rays cast and paths rejected; its error ends the stage.
pub type Report<'t> = dyn FnMut(RayCount) -> Result<(), Termination> + 't;

/// The search for lobes over the spots of all objects.
pub struct Lobes<'a> {
    problem: &'a Problem,
    seed: u64,
    /// Approximate number of paths for each fit of an object.
    pub paths: u64,
    max_bounces: u32,
    spots: Vec<Vec<Spot>>,
}

impl<'a> Lobes<'a> {
    /// Groups the pixels into spots. Paths have at most `max_bounces` bounces.
    pub fn new(
        problem: &'a Problem,
        gbuffer: &GBuffer,
        seed: u64,
        paths: u64,
        max_bounces: u32,
    ) -> Self {
        Self {
            problem,
            seed,
            paths,
            max_bounces,
            spots: observations::spots(problem, gbuffer),
        }
    }

    fn gathering<'g>(
        &self,
        lit: &'g LitScene,
        object: usize,
        roughnesses: &'g [f64],
    ) -> Gathering<'g> {
        Gathering {
            lit,
            object: object as u32,
            points: SCREENED_POINTS,
            roughnesses,
            options: PathOptions {
                max_bounces: self.max_bounces,
                ..PathOptions::default()
            },
            seed: self.seed,
            pass: 0,
        }
    }

    /// For each of the given objects, the evidence for a lobe in standard errors, from differences between photographs of the
    /// same spots; `None` if too few spots are seen by several photographs.
    ///
    /// # Errors
    /// The error of `report`.
    pub fn evidence(
        &self,
        estimate: &Estimate,
        objects: &[usize],
        report: &mut Report,
    ) -> Result<Vec<Option<f64>>, Termination> {
        let lit = estimate.lit(&self.problem.scene);
        let mut all = Vec::with_capacity(objects.len());
        for &object in objects {
            let mut gathering = self.gathering(&lit, object, &screen::DRAWN);
            gathering.options.max_bounces = SCREENED_BOUNCES.min(self.max_bounces);
            // Emitters have albedo zero; a small one is assumed.
            let albedo = estimate.objects[object].albedo.max(Vec3::splat(0.05));
            let scene = &self.problem.scene;
            let (evidence, cast) =
                screen::evidence(&gathering, scene, &self.spots[object], albedo.as_dvec3());
            report(cast)?;
            all.push(evidence);
        }
        Ok(all)
    }

    /// Points per observation and set that the paths suffice for, if directions are sampled from `lobes` lobes and by cosine.
    fn points(&self, object: usize, lobes: usize, (min, max): (u64, u64)) -> u32 {
        let chosen = observations::choose(&self.spots[object], 1, MAX_OBSERVATIONS);
        let observations: usize = chosen.iter().map(|spot| spot.len()).sum();
        let points = self.paths / (2 * (1 + lobes) * observations.max(1)) as u64;
        points.clamp(min, max) as u32
    }

    /// Whether the evidence suffices for a trial.
    pub fn is_promising(evidence: Option<f64>) -> bool {
        evidence.is_some_and(|t| t > MIN_EVIDENCE)
    }

    /// Fits an object's lobe from scratch. One that just misses significance is fitted again with more paths.
    ///
    /// # Errors
    /// The error of `report`.
    pub fn try_lobe(
        &mut self,
        lit: &LitScene,
        object: usize,
        emits: bool,
        report: &mut Report,
    ) -> Result<Option<LobeFit>, Termination> {
        let first = self.find(lit, object, emits, None, report)?;
        match first {
            Some(found) if found.is_likely() && !found.is_significant() => {
                let paths = self.paths;
                self.paths = paths * SECOND_TRIAL_PATHS;
                let second = Some((found.lobe(), SECOND_TRIAL));
                let found = self.find(lit, object, emits, second, report);
                self.paths = paths;
                found
            }
            _ => Ok(first),
        }
    }

    /// Fits an object's lobe, from scratch or near a known one; `None` if the observations do not determine it. `known` holds the
    /// lobe and the number of the refit, whose paths are independent of other refits.
    ///
    /// # Errors
    /// The error of `report`.
    pub fn find(
        &self,
        lit: &LitScene,
        object: usize,
        emits: bool,
        known: Option<(Lobe, u64)>,
        report: &mut Report,
    ) -> Result<Option<LobeFit>, Termination> {
        let scene = &self.problem.scene;
        let spots = &self.spots[object];
        let mut within = |bounds, drawn: &[f64], points, pass| -> Result<_, Termination> {
            let mut gathering = self.gathering(lit, object, drawn);
            gathering.points = self.points(object, drawn.len(), points);
            gathering.pass = pass;
            let (observations, cast) =
                LitObservations::new(&gathering, scene, spots, MAX_OBSERVATIONS);
            report(cast)?;
            Ok(find(&observations, emits, bounds))
        };
        let (roughness, pass, points) = match known {
            Some((lobe, refit)) => (f64::from(lobe.roughness), 3 + refit, REFIT_POINTS),
            None => match within([0.0, 1.0], &FIRST_DRAWN, FIRST_POINTS, 1)? {
                Some(first) => (first.roughness, 2, SECOND_POINTS),
                None => return Ok(None),
            },
        };
        let near = [roughness / NEAR, roughness * NEAR];
        within(near, &[roughness], points, pass)
    }
}
