//! The transport-cache solver: a light-field start, then rounds of full paths until the errors are small enough.

mod depth;
mod detail;
mod exposures;
mod known;
mod lamps;
mod light_field;
mod lobes;
mod refit;
mod rounds;
mod search;
mod trace;

use super::budget::Budget;
use super::clusters::{Cluster, brightness, cluster, mean_radiance};
use super::errors::{StandardErrors, standard_errors};
use super::evaluate::Linearised;
use super::fit::{Fit, fit};
use super::lamp_patches::LampPatches;
use super::prior::{ExpectedAlbedo, Prior};
use super::robust_weights::RobustWeights;
use super::roles::{self, Role};
use super::state::SolverState;
use super::trace::OutsideGrid;
use super::{PathCache, describe, model_error};
use crate::error;
use crate::inverse::estimate::Estimate;
use crate::inverse::exposure::{Exposures, Observations, OutlierFrames};
use crate::inverse::gbuffer::GBuffer;
use crate::inverse::loss::{LossProbe, Losses};
use crate::inverse::monitor::Monitor;
use crate::inverse::outside::MeasuredOutside;
use crate::inverse::overexposed;
use crate::inverse::parameters::Unknowns;
use crate::inverse::settings::Settings;
use crate::inverse::solver::{Checkpoint, Problem, Solution, Stage, Termination};
use crate::transport::material::Lobe;
use crate::transport::surroundings::Surroundings;
use detail::Detail;
use glam::Vec3;
use rounds::Summed;

/// Gauss–Newton steps at most in one fit.
const MAX_STEPS: u64 = 30;
/// Columns and rows of the map of light from outside.
const OUTSIDE_WIDTH: usize = 12;
const OUTSIDE_HEIGHT: usize = 6;
/// Longest path in bounces of losses, textures, lobes and of what lamps reflect; those of the fits end by chance alone.
const MAX_DEPTH: u32 = 1000;
/// Searches for lamps out of sight at most.
const MAX_SEARCHES: usize = 3;
/// Part of the mesh's area that a surface out of sight must have for its albedo to be fitted: what is smaller changes the light
/// in the room by less than the errors that are aimed at.
const UNSEEN_AREA: f64 = 1e-3;
/// Stages of a solve that goes all the way.
const STAGES: u32 = 4;

/// The state of a solve.
pub struct Pipeline<'a, 'o> {
    problem: &'a Problem,
    budget: Budget,
    monitor: Monitor<'o>,
    gbuffer: GBuffer,
    clusters: Vec<Cluster>,
    widths: Vec<u32>,
    /// In square metres.
    mesh_area: f64,
    losses: LossProbe,
    max_bounces: u32,
    outside: OutsideGrid,
    /// Whether light comes from outside.
    open: bool,
    /// What is known of it from pixels that see it, if light comes from there.
    sky: Option<MeasuredOutside>,
    roles: Vec<Role>,
    robust: RobustWeights,
    prior: Prior,
    /// Of the lamps, once all of them are found.
    patches: LampPatches,
    /// For each surface, the fraction of the paths' noise in its residuals.
    path_noise: Vec<f64>,
    unknowns: Unknowns,
    errors: StandardErrors,
    /// Variance of what the model lacks, relative to what surfaces reflect.
    model_variance: f64,
    /// The rough specular lobe of each object that has one.
    lobes: Vec<Option<Lobe>>,
    /// Where the photographs disagree.
    exposures: Option<Exposures>,
    estimate: Estimate,
    /// What the rounds know, once they are done.
    summed: Option<Summed>,
    /// Spatial detail, once it was looked for.
    detail: Option<Detail>,
    /// Mean of each surface's brightest channel in the photographs; zero where none sees it.
    brightness: Vec<f32>,
    /// Stages finished.
    stages: u32,
    /// Where the last of them ended.
    checkpoint: Checkpoint,
}

/// Solves a problem with the transport cache.
///
/// # Errors
/// The checkpoint belongs to another capture.
pub fn solve(
    problem: &Problem,
    settings: &Settings,
    resume: Option<&Checkpoint>,
    mut monitor: Monitor,
) -> error::Result<Solution> {
    let budget = Budget::of(settings);
    let objects = problem.scene.objects.len();
    let outside = OutsideGrid {
        first: objects as u32,
        width: OUTSIDE_WIDTH,
        height: OUTSIDE_HEIGHT,
        surroundings: Surroundings::Far,
    };
    let surfaces = objects + outside.surfaces();
    monitor.phase("looking through the pixels");
    let started = monitor.seconds();
    let mut gbuffer = GBuffer::new(problem, settings, budget.gbuffer_pixels);
    monitor.progress.rays += gbuffer.rays;
    let mut observations =
        (settings.leave_out || settings.exposures).then(|| Observations::new(problem, &gbuffer));
    let outliers = (observations.as_mut())
        .filter(|_| settings.leave_out)
        .and_then(|observations| OutlierFrames::new(observations, problem.photographs.len()))
        .filter(|outliers| !outliers.outliers.is_empty());
    let agreeing = outliers
        .as_ref()
        .map(|outliers| outliers.without_outliers(problem));
    let problem = agreeing.as_ref().unwrap_or(problem);
    if let Some(outliers) = outliers {
        gbuffer = GBuffer::new(problem, settings, budget.gbuffer_pixels);
        monitor.progress.rays += gbuffer.rays;
        monitor.progress.warnings = outliers.remarks();
    }
    let exposures = (observations.as_ref())
        .filter(|_| settings.exposures)
        .and_then(|observations| Exposures::new(problem, observations));
    let needed = exposures.as_ref().filter(|e| e.needed());
    let undone = needed.map(|exposures| exposures.undone(problem));
    let problem = undone.as_ref().unwrap_or(problem);
    // Of a mesh that is no scan the mixtures at outlines are known.
    let bounded = match problem.scene.scanned {
        true => overexposed::bounded(problem, &gbuffer),
        false => None,
    };
    let problem = bounded.as_ref().unwrap_or(problem);
    let max_bounces = settings.max_bounces().min(MAX_DEPTH);
    let clusters = cluster(problem, &gbuffer, budget.pixels);
    let prior = Prior::new(surfaces, objects, mean_radiance(&clusters))
        .with_known(&monitor.known)
        .with_albedo(ExpectedAlbedo::unknown(surfaces, &gbuffer.seen));
    let start = match resume {
        Some(checkpoint) => {
            checkpoint.state(|state: &SolverState| state.fits(surfaces, outside.surfaces()))?
        }
        None => SolverState::new(
            0,
            false,
            &prior,
            &vec![Role::Reflector; surfaces],
            &Unknowns::new(surfaces),
            &StandardErrors {
                albedo: vec![Vec3::splat(0.5); surfaces],
                emission: vec![Vec3::INFINITY; surfaces],
            },
            &[],
        ),
    };
    let mut lobes = start.lobes();
    lobes.resize(objects, None);
    let sky = (start.open)
        .then(|| MeasuredOutside::new(problem, &gbuffer, start.surroundings))
        .flatten();
    let expected = (start.expected.clone()).unwrap_or_else(|| prior.albedo().clone());
    let prior = (prior.with_albedo(expected)).with_directions(start.directions.clone());
    let mut pipeline = Pipeline {
        problem,
        budget,
        losses: LossProbe::new(problem, settings, 400, 16, max_bounces),
        checkpoint: Checkpoint::new(&monitor.progress, &start),
        monitor,
        sky,
        open: start.open,
        brightness: brightness(&clusters, surfaces),
        clusters,
        gbuffer,
        widths: problem.photographs.iter().map(|p| p.width).collect(),
        mesh_area: problem.scene.objects.iter().map(|o| o.area).sum(),
        max_bounces,
        outside: OutsideGrid {
            surroundings: start.surroundings,
            ..outside
        },
        errors: start.errors(),
        model_variance: start.model_variance,
        roles: start.roles,
        robust: RobustWeights::even(surfaces),
        prior,
        patches: LampPatches::default(),
        path_noise: vec![1.0; surfaces],
        unknowns: start.unknowns,
        lobes,
        exposures: needed.cloned(),
        estimate: Estimate::default(),
        summed: None,
        detail: None,
        stages: start.stages,
    };
    pipeline.hold();
    pipeline.describe();
    if let Some(exposures) = exposures.filter(|_| resume.is_none()) {
        pipeline.tell_exposures(&exposures, started);
    }
    let termination = match pipeline.run() {
        Ok(termination) | Err(termination) => termination,
    };
    Ok(pipeline.finish(termination))
}

impl Pipeline<'_, '_> {
    fn run(&mut self) -> Result<Termination, Termination> {
        if self.stages < 1 {
            self.light_field()?;
            self.state(1);
            self.tell()?;
        }
        if self.budget.round_paths == 0 {
            return Ok(Termination::Converged);
        }
        if self.stages < 2 {
            self.objects()?;
            self.tell_depth();
            self.state(2);
            self.tell()?;
        }
        if self.stages < 3 {
            if self.monitor.settings.lobes {
                self.lobes()?;
                // Paths and textures are found under them.
                self.settle_lobes(0)?;
            }
            self.state(3);
            self.tell()?;
        }
        let ended = self.refine()?;
        self.settle_lobes(1)?;
        self.state(STAGES);
        Ok(ended)
    }

    /// Lets the observer keep the stage that has just been finished, however soon the next one is.
    fn tell(&mut self) -> Result<(), Termination> {
        self.monitor
            .report(&self.estimate, &|_| self.checkpoint.clone())
    }

    /// Takes what was seen of the outside for what to expect of the rest of it.
    fn expect_of_outside(&mut self) {
        if let Some(sky) = &self.sky {
            let grid = self.outside;
            let band = std::f64::consts::PI / grid.height as f64;
            let expected = |surface| match surface == grid.excess() {
                true => Vec3::ZERO,
                false => sky.expected(grid.direction(surface), band),
            };
            self.prior = self.prior.clone().with_sky(expected);
        }
    }

    /// Second stage: full paths to the lamps found. Lights that the first stage missed or imagined are tested here,
    /// where nothing but the model enters.
    fn objects(&mut self) -> Result<(), Termination> {
        let started = self.monitor.seconds();
        self.search_anew()?;
        let (mut cache, mut limit) = self.fit_full_paths()?;
        for _ in 1..MAX_SEARCHES {
            // Albedos that a lamp put right may show another.
            if !self.search_unseen(false)? {
                break;
            }
            (cache, limit) = self.fit_full_paths()?;
        }
        let added = self.test_glow(&cache)?;
        self.weigh(&cache)?;
        let why = match added.as_slice() {
            [] => "one albedo or one emission an object; no further light is called for".to_owned(),
            names => format!(
                "light added to {} where the photographs called for it",
                names.join(", ")
            ),
        };
        self.record("objects", started, true, why + &limit)?;
        Ok(())
    }

    /// Paths to the lamps as they are known, stored, with all roles settled on them; and what is to be said of their number.
    pub(super) fn fit_full_paths(&mut self) -> Result<(PathCache, String), Termination> {
        self.monitor.phase("tracing paths to the lamps");
        let lights = self.lights();
        let (cache, limit) = self.stored(&lights, None, 1, self.budget.round_paths)?;
        self.monitor.phase("fitting albedo and emission");
        // Tests of roles weigh all alike: whatever the residuals of a wrong role say is no measure of trust.
        self.robust = RobustWeights::even(self.roles.len());
        let fitted = self.fit(&cache)?;
        self.settle_roles(&cache, fitted)?;
        Ok((cache, limit))
    }

    /// The parameters that are fitted. What leaves a surface out of sight is one unknown to the light field, however much of it
    /// is reflected; paths that go all the way tell the albedo.
    fn free(&self) -> Vec<usize> {
        let has_albedo = |k| self.roles[k] != Role::Emitter && self.has_free_albedo(k);
        roles::free(&self.roles, has_albedo)
    }

    /// Whether a surface's albedo is fitted, if it is no lamp: where photographs see it, or where so much of it is out of sight
    /// that what it reflects counts.
    fn has_free_albedo(&self, k: usize) -> bool {
        match self.gbuffer.seen.get(k) {
            None => false,
            // What a lamp out of sight reflects cannot be told from its own light.
            Some(0) if self.stages == 0 || self.roles[k] == Role::Unseen => false,
            Some(0) => self.problem.scene.objects[k].area > UNSEEN_AREA * self.mesh_area,
            Some(_) => true,
        }
    }

    fn fit(&mut self, cache: &PathCache) -> Result<Fit, Termination> {
        let free = self.free();
        let (monitor, estimate, checkpoint) = (&mut self.monitor, &self.estimate, &self.checkpoint);
        let fitted = fit(
            cache,
            &self.unknowns,
            &free,
            &self.robust,
            &self.prior,
            MAX_STEPS,
            |_| {
                monitor.progress.iterations += 1;
                monitor.tick(estimate, &|_| checkpoint.clone())
            },
        )?;
        Ok(fitted)
    }

    /// Weighs the clusters by the residuals that the last fit left, and fits again.
    fn weigh(&mut self, cache: &PathCache) -> Result<(), Termination> {
        let residuals = cache.residuals(&self.unknowns);
        self.tell_model_error(&residuals);
        self.robust = RobustWeights::from_residuals(&residuals, self.roles.len());
        let fitted = self.fit(cache)?;
        self.take(&fitted);
        Ok(())
    }

    /// Takes over a fit under the present roles, with its errors.
    fn take(&mut self, fitted: &Fit) {
        let free = self.free();
        let errors = standard_errors(&fitted.equations, &free, self.roles.len());
        self.merge_errors(errors);
        self.take_values(fitted);
    }

    /// Takes over the unknowns alone; errors take longer where unknowns are many.
    fn take_values(&mut self, fitted: &Fit) {
        self.unknowns = fitted.unknowns.clone();
        self.hold();
        self.describe();
    }

    /// Takes over the errors of what is fitted; what is held keeps those that its tests gave it.
    fn merge_errors(&mut self, errors: StandardErrors) {
        for (k, role) in self.roles.iter().enumerate() {
            if *role != Role::Emitter && self.has_free_albedo(k) {
                self.errors.albedo[k] = errors.albedo[k];
            }
            if role.emits() {
                self.errors.emission[k] = errors.emission[k];
            }
        }
    }

    /// Finds how far the model is off from the residuals that a fit has left.
    fn tell_model_error(&mut self, residuals: &[Linearised]) {
        let textured = self.estimate.texels.as_ref().map(|t| t.textured.as_slice());
        self.model_variance = model_error::variance(
            &self.clusters,
            residuals,
            &self.unknowns,
            textured.unwrap_or(&[]),
        );
    }

    fn describe(&mut self) {
        self.estimate = describe::estimate(
            &self.problem.scene,
            &self.gbuffer,
            &self.roles,
            &self.unknowns,
            &self.errors,
            self.outside,
            self.sky.as_ref(),
            &self.lobes,
        );
        model_error::add_to(&mut self.estimate, &self.roles, self.model_variance);
        let exposures = self.exposures.as_ref();
        self.estimate.exposures = (exposures.filter(|e| e.differ)).map(|e| e.factors.clone());
        self.estimate.vignetting = exposures.and_then(|e| e.vignetting);
        self.estimate.response = exposures.and_then(|e| e.response);
        if let Some(detail) = &self.detail {
            let object_of = &self.problem.scene.object_of;
            let refined = detail.scaled_to(&self.unknowns.albedo, object_of);
            refined.apply(&mut self.estimate);
        }
        describe::doubt_white(&mut self.estimate, &self.brightness);
        self.describe_known();
    }

    fn measure(&mut self) -> Losses {
        let losses = self.losses.measure(self.problem, &self.estimate);
        self.monitor.cast(losses.cast);
        losses
    }

    /// Records a stage with its losses, which become a point of the loss curve.
    fn record(
        &mut self,
        name: &str,
        started: f64,
        kept: bool,
        why: String,
    ) -> Result<Losses, Termination> {
        let losses = self.measure();
        self.monitor.loss(losses.train, losses.held_out);
        let stage = Stage {
            name: name.to_owned(),
            seconds: self.monitor.seconds() - started,
            iterations: self.monitor.progress.iterations,
            train_loss: losses.train,
            held_out_loss: losses.held_out,
            kept,
            why,
        };
        self.monitor.stage(stage);
        self.monitor
            .report(&self.estimate, &|_| self.checkpoint.clone())?;
        Ok(losses)
    }

    /// Marks the end of a stage, from where a solve can be taken up again.
    fn state(&mut self, stages: u32) {
        self.stages = stages;
        self.monitor.progress.seconds = self.monitor.seconds();
        let mut state = SolverState::new(
            stages,
            self.open,
            &self.prior,
            &self.roles,
            &self.unknowns,
            &self.errors,
            &self.lobes,
        );
        state.model_variance = self.model_variance;
        state.surroundings = self.outside.surroundings;
        self.checkpoint = Checkpoint::new(&self.monitor.progress, &state);
    }

    fn finish(mut self, termination: Termination) -> Solution {
        // A finished stage has measured its loss already.
        let done = self.stages >= STAGES || termination == Termination::Converged;
        if !done {
            let losses = self.measure();
            self.monitor.loss(losses.train, losses.held_out);
        }
        self.monitor.phase("done");
        self.monitor.progress.seconds = self.monitor.seconds();
        Solution {
            estimate: self.estimate,
            progress: self.monitor.progress,
            termination,
            checkpoint: (!done).then_some(self.checkpoint),
        }
    }
}
